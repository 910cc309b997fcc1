// The plan with tightened limits, compared with the table that the build would have made from a cell file with these
// limits: random parameters of random cells.
#include "parameters/tightened_plan.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/cells.hpp"

namespace bms::parameters {
namespace {

using protection::Fault;
using protection::Quantity;

protection::PackDesign design(std::uint8_t cells) {
  return {.limits = tests::table9.limits, .capacity_ah = tests::table9.capacity_ah, .cells = cells, .temperatures = 4};
}

protection::PackDesign design_of(const protection::PackDesign& base, const Values& v) {
  protection::PackDesign d = base;
  d.limits.voltage_max_v = 1e-3 * at(v, Parameter::cell_voltage_max);
  d.limits.voltage_min_v = 1e-3 * at(v, Parameter::cell_voltage_min);
  d.limits.charge_current_max_a = 0.1 * at(v, Parameter::charge_current_max);
  d.limits.discharge_current_max_a = 0.1 * at(v, Parameter::discharge_current_max);
  d.limits.temperature_max_c = 0.1 * at(v, Parameter::temperature_max);
  d.limits.temperature_min_c = 0.1 * at(v, Parameter::temperature_min);
  return d;
}

bool is_voltage(Quantity q) {
  return q == Quantity::highest_cell_uv || q == Quantity::lowest_cell_uv || q == Quantity::pack_uv;
}

TEST(TightenedPlan, IsThatOfACellFileWithTheseLimitsOrSafer) {
  std::mt19937 random(1);
  std::size_t moved = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const std::uint8_t cells = trial % 2 == 0 ? 16 : 8;
    const protection::PackDesign base = design(cells);
    const Ranges ranges = ranges_of(base, {});
    Values values = initial_values(ranges);
    for (std::size_t k = 0; k < place(Parameter::charge_temperature_min); ++k)
      values[k] = std::uniform_int_distribution(ranges[k].lowest, ranges[k].highest)(random);
    const auto of_build = protection::protection_plan(base);
    protection::ProtectionPlan plan = of_build;
    tighten(plan, values, ranges, 100'000);
    const auto expected = protection::protection_plan(design_of(base, values));
    ASSERT_TRUE(sound(plan)) << trial;
    for (std::size_t k = 0; k < plan.rules.size(); ++k) {
      const auto& rule = plan.rules[k];
      const auto& build = of_build.rules[k];
      const auto& like = expected.rules[k];
      if (is_voltage(rule.quantity) && rule.fault != Fault::deep_discharge) {
        const bool above = rule.sense == protection::Sense::above;
        const double tolerance = 2.0 * (rule.quantity == Quantity::pack_uv ? cells : 1);
        const auto safer = [&](std::int32_t a, std::int32_t b) { return above ? std::min(a, b) : std::max(a, b); };
        EXPECT_NEAR(rule.threshold, safer(build.threshold, like.threshold), tolerance) << k;
        EXPECT_NEAR(rule.release, safer(build.release, like.release), tolerance) << k;
      } else if (rule.quantity == Quantity::highest_cdegc) {
        EXPECT_NEAR(rule.threshold, like.threshold, 1) << k;
      } else if (rule.fault == Fault::undertemperature) {
        EXPECT_NEAR(rule.threshold, like.threshold, 1) << k;
      } else {
        EXPECT_EQ(rule.threshold, build.threshold) << k;
      }
      moved += rule.threshold != build.threshold ? 1U : 0U;
      EXPECT_LE(rule.delay_us, build.delay_us);
    }
    EXPECT_NEAR(plan.limits.charge_ua_256th, expected.limits.charge_ua_256th, 2);
    EXPECT_NEAR(plan.limits.discharge_ua_256th, expected.limits.discharge_ua_256th, 2);
    EXPECT_NEAR(plan.derating.charge_max_ua, expected.derating.charge_max_ua, 1);
    EXPECT_NEAR(plan.excess.discharge_max_ua, expected.excess.discharge_max_ua, 1);
    EXPECT_NEAR(plan.derating.charge_warm.to, expected.derating.charge_warm.to, 1);
    EXPECT_NEAR(plan.derating.discharge_cold.from, expected.derating.discharge_cold.from, 1);
  }
  EXPECT_GT(moved, 3'000U);
}

TEST(TightenedPlan, OfTheInitialValuesIsThePlanOfTheBuild) {
  const protection::PackDesign base = design(16);
  const Ranges ranges = ranges_of(base, {});
  const auto of_build = protection::protection_plan(base);
  auto plan = of_build;
  tighten(plan, initial_values(ranges), ranges, 100'000);
  for (std::size_t k = 0; k < plan.rules.size(); ++k) {
    EXPECT_EQ(plan.rules[k].threshold, of_build.rules[k].threshold) << k;
    EXPECT_EQ(plan.rules[k].release, of_build.rules[k].release) << k;
    EXPECT_EQ(plan.rules[k].delay_us, of_build.rules[k].delay_us) << k;
  }
  EXPECT_EQ(plan.limits.charge_ua_256th, of_build.limits.charge_ua_256th);
  EXPECT_EQ(plan.excess.part_ua, of_build.excess.part_ua);
  EXPECT_EQ(plan.contactors.max_closing_gap_uv, of_build.contactors.max_closing_gap_uv);
  EXPECT_EQ(plan.contactors.half_time_constant_us, of_build.contactors.half_time_constant_us);
  EXPECT_EQ(plan.recovery_ua, of_build.recovery_ua);
}

TEST(TightenedPlan, IsSoundInEveryCornerOfTheRangesAndNotBeyond) {
  const protection::PackDesign base = design(16);
  Ranges ranges = ranges_of(base, {});
  EXPECT_TRUE(proved(protection::protection_plan(base), ranges, 100'000));
  ranges[place(Parameter::charge_temperature_min)].highest = 600;
  EXPECT_FALSE(proved(protection::protection_plan(base), ranges, 100'000)) << "charging would begin above its end";
}

}  // namespace
}  // namespace bms::parameters
