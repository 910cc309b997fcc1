#include "identification/hysteresis_gap.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace bms::identification {
namespace {

double factor(double energy_j_per_mol, double c) {
  return std::exp(energy_j_per_mol / 8.314462618 * (1 / (c + 273.15) - 1 / 298.15));
}

TEST(SlowGap, SeparatesHysteresisFromTheOvervoltageThatGrowsInTheCold) {
  std::vector<GapAtTemperature> gaps;
  int odd = 1;
  for (const double c : {-15.0, -5.0, 5.0, 15.0, 25.0, 35.0, 45.0})
    gaps.push_back({c, 0.018 + 0.004 * factor(40'000, c) + (odd = -odd) * 0.0005});
  const auto gap = slow_gap(gaps, 25);
  ASSERT_TRUE(gap);
  EXPECT_NEAR(gap->hysteresis_v, 0.018, 0.001);
  EXPECT_NEAR(gap->overvoltage_v, 0.004, 0.001);
  EXPECT_NEAR(gap->activation_j_per_mol, 40'000, 4'000);
  EXPECT_LT(gap->residual_v, 0.0006);
}

TEST(SlowGap, IsAllHysteresisIfTheGapDoesNotGrow) {
  const auto gap = slow_gap({{-5, 0.01}, {20, 0.01}, {45, 0.01}}, 25);
  ASSERT_TRUE(gap);
  EXPECT_NEAR(gap->hysteresis_v, 0.01, 1e-6);
  EXPECT_NEAR(gap->overvoltage_v, 0, 1e-6);
}

TEST(SlowGap, GivesTheOvervoltageAtTheReferenceTemperature) {
  std::vector<GapAtTemperature> gaps;
  for (const double c : {-15.0, 5.0, 25.0, 45.0}) gaps.push_back({c, 0.018 + 0.004 * factor(40'000, c)});
  const auto gap = slow_gap(gaps, 10);
  ASSERT_TRUE(gap);
  EXPECT_NEAR(gap->overvoltage_v, 0.004 * factor(40'000, 10), 1e-6);
  EXPECT_NEAR(gap->hysteresis_v, 0.018, 1e-6);
}

TEST(SlowGap, NeedsThreeTemperaturesFarApart) {
  EXPECT_FALSE(slow_gap({}, 25));
  EXPECT_FALSE(slow_gap({{0, 0.02}, {25, 0.01}}, 25));
  EXPECT_FALSE(slow_gap({{20, 0.02}, {25, 0.01}, {30, 0.01}}, 25));
}

}  // namespace
}  // namespace bms::identification
