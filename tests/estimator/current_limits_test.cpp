#include "estimator/current_limits.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "plant/truth_cell.hpp"
#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

/// table9 as a cell that may be driven as hard as its voltage allows.
model::CellParameters<> hard() {
  model::CellParameters<> p = tests::table9;
  p.limits.charge_current_max_a = p.limits.discharge_current_max_a = 400;
  return p;
}

template <class S>
std::pair<double, double> limits(const model::CellParameters<>& p, double soc, double seconds, double margin_v = 0,
                                 double v_rc_v = 0, double off = 0) {
  const auto cell = model::prepare<S, model::max_intervals>(p);
  const auto l = current_limits<model::ExtendedRc<0, 0>::Of<S>>(
      cell, {arithmetic::Voltage<S>(v_rc_v)}, arithmetic::Soc<S>(soc), arithmetic::Soc<S>(off),
      arithmetic::Temperature<S>(25), arithmetic::TimeStep<S>(seconds), arithmetic::Voltage<S>(margin_v));
  return {arithmetic::as_double(l.discharge_a), arithmetic::as_double(l.charge_a)};
}

TEST(CurrentLimits, ACellThatIsDrivenByThemReachesItsVoltageLimitsAndDoesNotPassThem) {
  const model::CellParameters<> p = hard();
  for (const double soc : {0.3, 0.5, 0.7, 0.85}) {
    for (const double seconds : {1.0, 10.0}) {
      const auto [discharge_a, charge_a] = limits<double>(p, soc, seconds);
      plant::Cell down({}, {.soc = soc, .v_rc_v = 0, .temperature_c = 25}), up = down;
      down.run(-discharge_a, 25, seconds);
      up.run(charge_a, 25, seconds);
      EXPECT_NEAR(down.voltage_v(), p.limits.voltage_min_v, 0.03) << soc << ' ' << seconds;  // 2 % of 1.3 V of drop
      EXPECT_NEAR(up.voltage_v(), p.limits.voltage_max_v, 0.01) << soc << ' ' << seconds;
    }
  }
}

TEST(CurrentLimits, AreNoMoreThanTheFileAllows) {
  const auto [discharge_a, charge_a] = limits<double>(tests::table9, 0.5, 10);
  EXPECT_EQ(discharge_a, 6);
  EXPECT_EQ(charge_a, 6);
}

TEST(CurrentLimits, AreLessForLongerAndWithAMargin) {
  const auto now = limits<double>(hard(), 0.5, 0.1), later = limits<double>(hard(), 0.5, 10),
             careful = limits<double>(hard(), 0.5, 10, 0.03);
  EXPECT_GT(now.first, 1.2 * later.first);
  EXPECT_GT(now.second, 1.2 * later.second);
  EXPECT_LT(careful.first, later.first - 1);
  EXPECT_LT(careful.second, later.second - 1);
}

TEST(CurrentLimits, AFullCellTakesNothingAndAnEmptyOneGivesLittle) {
  EXPECT_EQ(limits<double>(hard(), 1.2, 10).second, 0) << "above its largest voltage at rest";
  EXPECT_LT(limits<double>(hard(), 0.002, 10).first, limits<double>(hard(), 0.3, 10).first / 2);
}

TEST(CurrentLimits, AnUncertainSocIsTakenForTheWorse) {
  const auto sure = limits<double>(hard(), 0.06, 10), unsure = limits<double>(hard(), 0.06, 10, 0, 0, 0.04);
  EXPECT_LT(unsure.first, sure.first - 1);
  EXPECT_LT(limits<double>(hard(), 0.94, 10, 0, 0, 0.04).second, limits<double>(hard(), 0.94, 10).second - 1);
}

TEST(CurrentLimits, WhatHasBuiltUpCounts) {
  EXPECT_LT(limits<double>(hard(), 0.5, 1, 0, 0.05).second, limits<double>(hard(), 0.5, 1, 0, 0).second - 1);
}

TEST(CurrentLimits, EveryScalarGivesTheSameLimits) {
  for (const double soc : {0.05, 0.4, 0.95}) {
    const auto float64 = limits<double>(hard(), soc, 10), float32 = limits<float>(hard(), soc, 10),
               fixed = limits<arithmetic::FixedPoint>(hard(), soc, 10);
    EXPECT_NEAR(float32.first, float64.first, 0.02);
    EXPECT_NEAR(fixed.first, float64.first, 0.02);
    EXPECT_NEAR(float32.second, float64.second, 0.02);
    EXPECT_NEAR(fixed.second, float64.second, 0.02);
  }
}

}  // namespace
}  // namespace bms::estimator
