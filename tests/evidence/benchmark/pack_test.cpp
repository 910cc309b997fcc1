// Simulated packs with planted faults: the cell and the cause are named, and nothing else.
#include <algorithm>
#include <cmath>
#include <string_view>

#include <gtest/gtest.h>

#include "benchmark/pack_score.hpp"
#include "benchmark/truth/case_files.hpp"
#include "benchmark/truth/packs.hpp"
#include "files/cell_file.hpp"
#include "workflow/pack_diagnosis.hpp"

namespace bms {
namespace {

namespace truth = benchmark::truth;

benchmark::PackOutcome outcome_of(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only = {}) {
  const truth::PackCase c = truth::make_pack(seed, index, healthy, only);
  measurement::Recording r;
  r.time_s = c.recording.time_s;
  r.current_a = c.recording.current_a;
  for (const auto& v : c.recording.cell_v) r.cell_voltage_v.emplace_back(v);
  for (const auto& t : c.recording.sensor_c) r.cell_temperature_c.emplace_back(t);
  r.pack_voltage_v = c.recording.pack_v;
  workflow::PackOptions options;
  options.initial_soc = c.given_initial_soc;
  options.shared = false;
  const auto cell = files::parse_cell(truth::cell_toml(c.cell, "pack"), "pack");
  return benchmark::score_pack(c, workflow::diagnose_pack(cell, r, options).diagnosis);
}

TEST(Pack, NamesACellWithLessChargeAmongChannelsThatAreReadOneAfterTheOther) {
  const benchmark::PackOutcome o = outcome_of(2, 10, false);
  ASSERT_EQ(o.planted.size(), 2);
  for (const benchmark::PlantedOutcome& p : o.planted) EXPECT_TRUE(p.named) << p.fault.id << ": " << o.statement;
  EXPECT_TRUE(o.wrong.empty()) << o.statement;
}

TEST(Pack, FindsAHeldChannelAndHowLong) {
  const benchmark::PackOutcome o = outcome_of(2, 9, false);
  ASSERT_EQ(o.planted.front().fault.id, "channel_held");
  EXPECT_TRUE(o.planted.front().named) << o.statement;
  EXPECT_EQ(o.planted.front().found, o.planted.front().fault.size);
  EXPECT_TRUE(o.wrong.empty()) << o.statement;
}

TEST(Pack, FindsTheOffsetOfTheCurrentSensorAndItsSizeFromTheMeanOfTheCells) {
  const benchmark::PackOutcome o = outcome_of(101, 0, false);
  const auto is_offset = [](const benchmark::PlantedOutcome& p) { return p.fault.id == "current_offset"; };
  const auto offset = std::find_if(o.planted.begin(), o.planted.end(), is_offset);
  ASSERT_NE(offset, o.planted.end());
  EXPECT_TRUE(offset->named) << o.statement;
  EXPECT_LT(std::abs(offset->pull), 3);
  EXPECT_TRUE(o.wrong.empty()) << o.statement;
}

TEST(Pack, SeparatesAGrownResistanceFromAJointInTheSamePack) {
  const benchmark::PackOutcome o = outcome_of(101, 1, false);
  ASSERT_EQ(o.planted[1].fault.id, "resistance_growth");
  ASSERT_EQ(o.planted[2].fault.id, "joint_resistance");
  for (const benchmark::PlantedOutcome& p : o.planted) EXPECT_TRUE(p.named) << p.fault.id << ": " << o.statement;
  EXPECT_TRUE(o.wrong.empty()) << o.statement;
}

/// A grown resistance warms its cell. Without that, it was found with 1.76 times its size.
TEST(Pack, SizesAGrownResistanceThatWarmsItsCell) {
  const benchmark::PackOutcome o = outcome_of(8111, 1, false, "resistance_growth");
  ASSERT_EQ(o.planted.size(), 1);
  ASSERT_TRUE(o.planted[0].named) << o.statement;
  EXPECT_NEAR(o.planted[0].found / o.planted[0].fault.size, 1, 0.2);
  EXPECT_LT(std::abs(o.planted[0].pull), 3);
  EXPECT_TRUE(o.wrong.empty()) << o.statement;
}

TEST(Pack, NamesNothingInAHealthyPack) {
  const benchmark::PackOutcome o = outcome_of(2, 0, true);
  EXPECT_EQ(o.verdict, "NO_MISMATCH");
  EXPECT_TRUE(o.wrong.empty()) << o.statement;
}

}  // namespace
}  // namespace bms
