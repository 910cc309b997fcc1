#include "tests/truth/forklift_shift.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

namespace bms::plant {
namespace {

double charge_ah(const std::vector<bms::experiments::ProfileRow>& rows) {
  double sum_as = 0, before_s = 0;
  for (const bms::experiments::ProfileRow& row : rows) {
    sum_as += row.current_a * (row.time_s - before_s);
    before_s = row.time_s;
  }
  return sum_as / 3'600;
}

TEST(ForkliftShift, StaysWithin1CAndBetween10And100PercentForAnySeed) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const auto rows = bms::experiments::experiment("forklift_shift", {.seed = seed}).value();
    ASSERT_EQ(rows.size(), 28'801U);
    double soc = 0.98, lowest = soc, highest = soc;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      ASSERT_EQ(rows[k].time_s, static_cast<double>(k));
      ASSERT_LE(std::abs(rows[k].current_a), 6);
      if (k <= 300) {
        ASSERT_EQ(rows[k].current_a, 0);
      }
      soc += rows[k].current_a / 3'600 / 6;
      lowest = std::fmin(lowest, soc);
      highest = std::fmax(highest, soc);
    }
    EXPECT_GT(lowest, 0.1) << seed;
    EXPECT_LT(lowest, 0.35) << seed;
    EXPECT_LT(highest, 0.99) << seed;
  }
}

TEST(ForkliftShift, HasTheSameChargeAtEveryStepSizeAndScalesWithTheCell) {
  const double at_1s_ah = charge_ah(bms::experiments::experiment("forklift_shift").value());
  // Rounding to 1 mA, at random: 0.3 mA / sqrt(28,800) of 8 h.
  EXPECT_NEAR(charge_ah(bms::experiments::experiment("forklift_shift", {.step_s = 0.3}).value()), at_1s_ah, 1e-4);
  EXPECT_NEAR(charge_ah(bms::experiments::experiment("forklift_shift", {.step_s = 10}).value()), at_1s_ah, 1e-4);
  EXPECT_NEAR(charge_ah(bms::experiments::experiment("forklift_shift", {.capacity_ah = 2.5}).value()),
              at_1s_ah * 2.5 / 6, 1e-4);
}

TEST(ForkliftShift, DiffersBySeedAndOtherNamesAreUnknown) {
  const auto one = bms::experiments::experiment("forklift_shift", {.seed = 1}).value(),
             other = bms::experiments::experiment("forklift_shift", {.seed = 2}).value();
  const auto equal = [](const bms::experiments::ProfileRow& a, const bms::experiments::ProfileRow& b) {
    return a.current_a == b.current_a;
  };
  EXPECT_FALSE(std::equal(one.begin(), one.end(), other.begin(), other.end(), equal));
  EXPECT_FALSE(bms::experiments::experiment("forklift").has_value());
}

// No libm, no fused multiply-add, printed by to_chars: equal means equal.
TEST(ForkliftShift, CommittedRecordingIsWhatTheProgramMakes) {
  std::ifstream file(BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv", std::ios::binary);
  ASSERT_TRUE(file) << "evidence/recordings/forklift_shift.csv is missing";
  std::istringstream made(forklift_shift_csv());
  std::string line, made_line;
  int lines = 0;
  while (std::getline(made, made_line)) {
    ++lines;
    ASSERT_TRUE(std::getline(file, line)) << "the recording ends before line " << lines;
    ASSERT_EQ(line, made_line) << "line " << lines << "; if the change is meant, run the target make_forklift_shift";
  }
  EXPECT_FALSE(std::getline(file, line)) << "the recording goes on after line " << lines;
  EXPECT_EQ(lines, 28'806);
}

}  // namespace
}  // namespace bms::plant
