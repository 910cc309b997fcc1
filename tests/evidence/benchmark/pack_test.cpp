// Simulated packs with planted faults: the cell and the cause are named, and nothing else.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include <gtest/gtest.h>

#include "benchmark/pack_run.hpp"
#include "benchmark/truth/packs.hpp"

namespace bms {
namespace {

namespace truth = benchmark::truth;

diagnosis::pack::PackDiagnosis diagnosis_of(const truth::PackCase& c) {
  return benchmark::diagnose(c, false).diagnosis;
}

benchmark::PackOutcome outcome_of(std::uint64_t seed, std::size_t index, bool healthy, std::string_view only = {}) {
  return benchmark::run_pack(truth::make_pack(seed, index, healthy, only), false);
}

/// A healthy pack of 14 cells, three hours in rows of 1 s.
truth::PackCase healthy_under_a_pump() {
  return truth::make_slow_pack(4127, 16, true, {}, {.load = truth::PackLoad::pump, .rows_s = 1, .hours = 3});
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

TEST(Pack, LeavesACellInPeaceWhoseFitHasToMoveAgainstAGrowingNoise) {
  const auto d = diagnosis_of(healthy_under_a_pump());
  EXPECT_EQ(d.verdict, diagnosis::Verdict::no_mismatch) << d.statement;
}

TEST(Pack, SaysThatACellIsUnknownWhoseReadingDriftsUpAndDown) {
  truth::PackCase c = healthy_under_a_pump();
  constexpr std::size_t cell = 6;
  constexpr double drift_v = 0.012, period_s = 3'000;
  for (std::size_t k = 0; k < c.recording.time_s.size(); ++k)
    c.recording.cell_v[cell][k] += drift_v * std::sin(2 * std::numbers::pi * c.recording.time_s[k] / period_s);
  const auto d = diagnosis_of(c);
  EXPECT_EQ(d.verdict, diagnosis::Verdict::unknown) << d.statement;
  ASSERT_EQ(d.unexplained.size(), 1) << d.statement;
  EXPECT_EQ(d.unexplained[0].cell, cell);
  EXPECT_TRUE(d.findings.empty()) << d.statement;
}

}  // namespace
}  // namespace bms
