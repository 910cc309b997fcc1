#include "estimator/outlier_gate.hpp"

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

using Gate = OutlierGate<double>;
constexpr std::uint64_t second_us = 1'000'000;

TEST(OutlierGate, RejectsWhatIsBeyondEightStandardDeviations) {
  EXPECT_FALSE(Gate::is_suspect(0.0799));
  EXPECT_TRUE(Gate::is_suspect(-0.0801)) << "eight times the smallest standard deviation of any model";
  EXPECT_FALSE(Gate::is_outlier(0.159, 0.02 * 0.02));
  EXPECT_TRUE(Gate::is_outlier(-0.161, 0.02 * 0.02));
}

TEST(OutlierGate, AsksForARestartAfterTenMinutesOfOutliersAndCountsAgainAfterIt) {
  Gate gate;
  std::uint64_t time_us = 0;
  const auto outliers_until_restart = [&] {
    int count = 1;
    while (!gate.has_persisted(time_us += second_us, second_us)) ++count;
    return count;
  };
  EXPECT_EQ(outliers_until_restart(), 600);
  EXPECT_EQ(outliers_until_restart(), 600);
}

TEST(OutlierGate, AMinuteWithoutAnOutlierEndsTheCount) {
  Gate gate;
  for (int k = 1; k <= 599; ++k) ASSERT_FALSE(gate.has_persisted(static_cast<std::uint64_t>(k) * second_us, second_us));
  EXPECT_FALSE(gate.has_persisted(661 * second_us, second_us));
  EXPECT_FALSE(gate.has_persisted(662 * second_us, second_us));
}

TEST(OutlierGate, ALongStepCountsAsAMinuteAtMost) {
  Gate gate;
  constexpr std::uint64_t hour_us = 3'600 * second_us;
  for (std::uint64_t k = 1; k < 10; ++k) EXPECT_FALSE(gate.has_persisted(k * hour_us, hour_us)) << k;
  EXPECT_TRUE(gate.has_persisted(10 * hour_us, hour_us));
}

}  // namespace
}  // namespace bms::estimator
