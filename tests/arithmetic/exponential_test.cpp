#include "arithmetic/exponential.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>

namespace bms::arithmetic {
namespace {

TEST(Exponential, SettlesLikeTheExponentialFunctionForEveryScalar) {
  for (double x = 1e-7; x < 40; x *= 1.07) {
    const double expected = -std::expm1(-x);
    EXPECT_NEAR(step_response<double>(x), expected, 4e-15 * expected) << x;
    EXPECT_NEAR(step_response<float>(static_cast<float>(x)), -std::expm1(-static_cast<double>(static_cast<float>(x))),
                4e-7 * expected)
        << x;
    // the polynomial's own error in real numbers; x and the result rounded to half a step of 2^-29 each, what is
    // multiplied by x <= 1/4 to 1.8 steps
    EXPECT_NEAR(static_cast<double>(step_response<FixedPoint>(Q<15, 47>(x))), expected,
                2.54e-7 * expected + (0.5 + 0.5 + 0.45) * 0x1p-29)
        << x;
  }
}

TEST(Exponential, IsZeroAtZeroAndOneFarOut) {
  EXPECT_EQ(step_response<float>(0.0F), 0.0F);
  EXPECT_EQ(step_response<double>(1e300), 1.0);
  EXPECT_EQ(static_cast<double>(step_response<FixedPoint>(Q<15, 47>(20'000))), 1.0);
}

TEST(Exponential, DerivativeIsTheUnsettledPart) {
  for (const double x : {0.001, 0.2, 0.2500001, 0.6, 3.0, 17.0}) {
    const auto p = step_response<ceres::Jet<double, 1>>({x, 0});
    EXPECT_NEAR(p.v[0], std::exp(-x), 1e-13) << x;
  }
}

}  // namespace
}  // namespace bms::arithmetic
