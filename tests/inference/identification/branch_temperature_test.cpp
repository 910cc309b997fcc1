#include "identification/branch_temperature.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace bms::identification {
namespace {

double line(double soc, double at_10, double at_85) { return at_10 + (at_85 - at_10) * (soc - 0.1) / 0.75; }

/// A cell whose hysteresis is constant and whose slow current has an overvoltage over surfaces that are nearly empty
/// (on discharge) or full (on charge): not of the form of the laws.
CurveAtTemperature cell_at(double c) {
  CurveAtTemperature at{c, {}};
  at.curve.capacity_ah = 2.5;
  at.curve.coulombic_efficiency = 1;
  const double activated = std::exp(35'000 / 8.314462618 * (1 / (c + 273.15) - 1 / 298.15));
  for (int g = 0; g <= 500; ++g) {
    const double soc = g / 500.0;
    const double middle_v = 3.2 + 0.1 * soc + 1e-4 * (c - 25) * line(soc, 2, -1);
    const double down_v = 0.015 + 0.004 * activated * (1 + 0.1 / (soc + 0.05)),
                 up_v = 0.015 + 0.004 * activated * (1 + 0.1 / (1.05 - soc));
    at.curve.soc.push_back(soc);
    at.curve.charge_v.push_back(middle_v + up_v);
    at.curve.discharge_v.push_back(middle_v - down_v);
    at.curve.ocv_v.push_back(middle_v + (up_v - down_v) / 2);
    at.curve.half_gap_v.push_back((up_v + down_v) / 2);
  }
  return at;
}

TEST(BranchTemperature, PredictsBothBranchesAtATemperatureThatWasNotMeasured) {
  for (const double left_out_c : {5.0, 15.0, 25.0}) {
    std::vector<CurveAtTemperature> curves;
    for (const double c : {-15.0, -5.0, 5.0, 15.0, 25.0, 45.0}) {
      if (c != left_out_c) curves.push_back(cell_at(c));
    }
    const auto laws = fit_branches(curves, left_out_c);
    ASSERT_TRUE(laws);
    EXPECT_LT(laws->residual_v, 0.003) << left_out_c;
    const auto nearest = std::min_element(curves.begin(), curves.end(), [&](const auto& a, const auto& b) {
      return std::abs(a.temperature_c - left_out_c) < std::abs(b.temperature_c - left_out_c);
    });
    const OcvCurve predicted = moved_to_reference(*nearest, *laws);
    const OcvCurve truth = cell_at(left_out_c).curve;
    for (std::size_t g = 50; g <= 450; ++g) {
      EXPECT_NEAR(predicted.discharge_v[g], truth.discharge_v[g], 0.0015) << left_out_c << ' ' << truth.soc[g];
      EXPECT_NEAR(predicted.charge_v[g], truth.charge_v[g], 0.0015) << left_out_c << ' ' << truth.soc[g];
      EXPECT_NEAR(predicted.half_gap_v[g], truth.half_gap_v[g], 0.0015);
    }
  }
}

TEST(BranchTemperature, NeedsNoChargeBranchNearFullInTheCold) {
  std::vector<CurveAtTemperature> curves;
  for (const double c : {-15.0, -5.0, 5.0, 25.0, 45.0}) {
    curves.push_back(cell_at(c));
    if (c > 0) continue;
    for (std::size_t g = 420; g <= 500; ++g) curves.back().curve.charge_v[g] = std::numeric_limits<double>::quiet_NaN();
  }
  const auto laws = fit_branches(curves, 25);
  ASSERT_TRUE(laws);
  EXPECT_LT(laws->residual_v, 0.003);
}

TEST(BranchTemperature, SettingsForAHalfGapStayWithinTheirBounds) {
  const auto laws = fit_branches({cell_at(-15), cell_at(5), cell_at(25), cell_at(45)}, 25);
  ASSERT_TRUE(laws);
  for (const double half_gap_v : {0.02, 1e-4}) {
    const auto values = for_half_gap(*laws, half_gap_v);
    for (std::size_t k = 0; k < values.size(); ++k) {
      EXPECT_GE(values[k], model::BranchTemperature::parameters[k].low);
      EXPECT_LE(values[k], model::BranchTemperature::parameters[k].high);
    }
    if (half_gap_v > 0.01) {
      EXPECT_NEAR(values[2] * half_gap_v, laws->branches[2], 1e-12);
    }
  }
}

TEST(BranchTemperature, NeedsThreeTemperaturesFarApartWithBothKindsOfRun) {
  EXPECT_FALSE(fit_branches({}, 25));
  EXPECT_FALSE(fit_branches({cell_at(0), cell_at(25)}, 25));
  EXPECT_FALSE(fit_branches({cell_at(20), cell_at(25), cell_at(30)}, 25));
  std::vector<CurveAtTemperature> curves = {cell_at(-5), cell_at(5), cell_at(25)};
  curves[0].curve.coulombic_efficiency = std::nullopt;
  EXPECT_FALSE(fit_branches(curves, 25));
}

}  // namespace
}  // namespace bms::identification
