#include "estimator/start.hpp"

#include <gtest/gtest.h>

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
  return soc_from(StartMisfit<S, Cell>{cell, &reading, nullptr});
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

}  // namespace
}  // namespace bms::estimator
