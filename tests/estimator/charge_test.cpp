#include "estimator/charge.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include "tests/cells.hpp"

namespace bms::estimator {
namespace {

template <class S>
auto cell() {
  return tests::prepared<S>();
}

template <class Scalar>
class ChargeOfEveryScalar : public ::testing::Test {};
using Scalars = ::testing::Types<float, double, arithmetic::FixedPoint>;
TYPED_TEST_SUITE(ChargeOfEveryScalar, Scalars);

TYPED_TEST(ChargeOfEveryScalar, LosesNothingOfTenMilliamperesOver100HoursAt100Hz) {
  const auto scale = cell<TypeParam>().charge;
  Charge<TypeParam> charge;
  charge.set(arithmetic::Soc<TypeParam>(0.9), scale);
  for (int k = 0; k < 100 * 3'600 * 100; ++k) charge.count(-10'000, 10'000, scale);
  EXPECT_NEAR(arithmetic::as_double(charge.soc(scale)), 0.9 - 1.0 / 6, 1e-7);  // 1 Ah of 6
}

TYPED_TEST(ChargeOfEveryScalar, IsHeldWithinAQuarterBeyondEmptyAndFull) {
  const auto scale = cell<TypeParam>().charge;
  Charge<TypeParam> charge;
  charge.set(arithmetic::Soc<TypeParam>(0.5), scale);
  for (int k = 0; k < 1'000; ++k) charge.count(2'147'483'647, 2'000'000'000, scale);
  EXPECT_NEAR(arithmetic::as_double(charge.soc(scale)), 1.25, 1e-6);
  for (int k = 0; k < 1'000; ++k) charge.count(-2'147'483'647, 2'000'000'000, scale);
  EXPECT_NEAR(arithmetic::as_double(charge.soc(scale)), -0.25, 1e-6);
}

TYPED_TEST(ChargeOfEveryScalar, IsCorrectedToACountAndSurvivesAnAbsurdCorrection) {
  const auto scale = cell<TypeParam>().charge;
  Charge<TypeParam> charge;
  charge.set(arithmetic::Soc<TypeParam>(0.4), scale);
  charge.correct(arithmetic::Soc<TypeParam>(0.125), scale);
  EXPECT_NEAR(arithmetic::as_double(charge.soc(scale)), 0.525, 1e-7);
  charge.correct(arithmetic::Soc<TypeParam>(-7.0), scale);
  EXPECT_NEAR(arithmetic::as_double(charge.soc(scale)), -0.25, 1e-6);
}

TEST(Charge, OfAJetCarriesTheDerivative) {
  using Jet = ceres::Jet<double, 1>;
  const auto scale = cell<Jet>().charge;
  Charge<Jet> charge;
  charge.set(Jet(0.5, 0), scale);
  charge.count(-6'000'000, 1'800'000'000, scale);  // half an hour at 1C
  EXPECT_NEAR(charge.soc(scale).a, 0, 1e-12);
  EXPECT_EQ(charge.soc(scale).v[0], 1);
}

}  // namespace
}  // namespace bms::estimator
