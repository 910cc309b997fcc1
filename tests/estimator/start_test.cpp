#include "estimator/start.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

template <class Scalar>
class StartOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, arithmetic::FixedPoint>;
TYPED_TEST_SUITE(StartOfEveryScalar, Scalars);

template <class Cell, class V>
auto read(const Cell& cell, const V& ocv_v, double sigma_v) {
  using S = typename Cell::Scalar;
  const auto variance_v2 = arithmetic::Variance<S>(sigma_v * sigma_v);
  const OcvReading<S> reading{ocv_v, variance_v2, variance_v2};
  SocBank<S> bank;
  const StartMisfit<S, Cell, OcvReading<S>> misfit{cell, reading};
  const PriorMisfit<S> none;
  return StartSearch(misfit, none).run(bank);
}

template <class S>
std::pair<double, double> start(double voltage_v, double sigma_v) {
  const auto cell = tests::prepared<S>();
  const auto belief = read(cell, arithmetic::Voltage<S>(voltage_v), sigma_v);
  return {arithmetic::as_double(belief.soc), std::sqrt(arithmetic::as_double(belief.variance))};
}

TYPED_TEST(StartOfEveryScalar, IsNarrowWhereTheCurveIsSteep) {
  const auto [soc, sigma] = start<TypeParam>(2.871 + 3.35 * 0.05, 0.005);
  EXPECT_NEAR(soc, 0.05, 0.004);
  EXPECT_LT(sigma, 0.01);
}

TYPED_TEST(StartOfEveryScalar, IsAsWideAsThePlateau) {
  // 3.287 V +- 5 mV is any soc from about 0.38 to 0.63: 8 mV of curve over a quarter of the charge
  const auto [soc, sigma] = start<TypeParam>(3.287, 0.005);
  EXPECT_GT(soc, 0.40);
  EXPECT_LT(soc, 0.60);
  EXPECT_GT(sigma, 0.06);
  EXPECT_LT(sigma, 0.15);
}

TYPED_TEST(StartOfEveryScalar, HoldsTheTruthWithinTwoSigmaOnTheWholeCurve) {
  const auto cell = tests::prepared<double>();
  for (double soc = 0.01; soc < 1; soc += 0.01) {
    for (const double error_v : {-0.005, 0.0, 0.005}) {  // one standard deviation of a rested voltage
      const auto [found, sigma] = start<TypeParam>(model::look_up(cell, soc).ocv_v + error_v, 0.005);
      EXPECT_LT(std::abs(found - soc), 2.1 * sigma)
          << "at soc " << soc << ", " << error_v << " V off: " << found << " +- " << sigma;
    }
  }
}

TYPED_TEST(StartOfEveryScalar, AVoltageOutsideTheCurveIsItsEnd) {
  EXPECT_GT((start<TypeParam>(3.65, 0.005).first), 0.98);
  EXPECT_LT((start<TypeParam>(2.2, 0.005).first), 0.02);
}

/// Every SOC weighted by how well its OCV fits, in steps of 1/8,192.
std::pair<double, double> weighted_everywhere(double voltage_v, double sigma_v) {
  const auto cell = tests::prepared<double>();
  double weights = 0, first = 0, second = 0;
  for (double soc = 0.5 / 8'192; soc < 1; soc += 1.0 / 8'192) {
    const double ocv_v = model::look_up(cell, soc).ocv_v, off_v = voltage_v - ocv_v, axis = 3 * cell.noise.soc_axis,
                 there = off_v < 0 ? std::max(0.0, soc - axis) : std::min(1.0, soc + axis),
                 axis_v = (model::look_up(cell, there).ocv_v - ocv_v) / 3,
                 weight = std::exp(-off_v * off_v / (2 * (sigma_v * sigma_v + axis_v * axis_v)));
    weights += weight;
    first += weight * soc;
    second += weight * soc * soc;
  }
  const double mean = first / weights;
  return {mean, std::sqrt(second / weights - mean * mean)};
}

TYPED_TEST(StartOfEveryScalar, IsThatOfManyPoints) {
  const auto cell = tests::prepared<double>();
  for (const double sigma_v : {0.005, 0.01, 0.05}) {
    for (double soc = 0.005; soc < 1; soc += 0.005) {
      const double voltage_v = model::look_up(cell, soc).ocv_v;
      const auto [found, sigma] = start<TypeParam>(voltage_v, sigma_v);
      const auto [mean, deviation] = weighted_everywhere(voltage_v, sigma_v);
      EXPECT_NEAR(found, mean, 0.25 * sigma) << "at soc " << soc << ", " << sigma_v << " V";
      EXPECT_NEAR(sigma, deviation, 0.004 + 0.1 * deviation) << "at soc " << soc << ", " << sigma_v << " V";
    }
  }
}

}  // namespace
}  // namespace bms::estimator
