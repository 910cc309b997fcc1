#include "arithmetic/scaled.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "arithmetic/fixed.hpp"

namespace bms::arithmetic {
namespace {

double real(const Scaled& s) { return static_cast<double>(s); }

/// Over forty powers of two, of either sign.
Scaled any(std::mt19937_64& random) {
  return Scaled(
      std::ldexp(static_cast<double>(static_cast<std::int64_t>(random())), static_cast<int>(random() % 40) - 83));
}

TEST(Scaled, ArithmeticAgreesWithRealNumbersToItsDigits) {
  std::mt19937_64 random(1);
  for (int n = 0; n < 50'000; ++n) {
    const Scaled a = any(random), b = n % 7 == 0
                                          ? Scaled(-real(a) * (1 + std::ldexp(1.0, -static_cast<int>(random() % 30))))
                                          : any(random);
    const double x = real(a), y = real(b), larger = std::max(std::abs(x), std::abs(y));
    EXPECT_NEAR(real(a + b), x + y, 0x1p-28 * larger) << x << " " << y;
    EXPECT_NEAR(real(a - b), x - y, 0x1p-28 * larger) << x << " " << y;
    EXPECT_NEAR(real(a * b), x * y, (0x1p-26 + 0x1p-29) * std::abs(x * y)) << x << " " << y;
    EXPECT_NEAR(real(a.reciprocal()), 1 / x, 0x1p-27 / std::abs(x)) << x;
    EXPECT_NEAR(real((a < Scaled(0) ? -a : a).root()), std::sqrt(std::abs(x)), 0x1p-26 * std::sqrt(std::abs(x))) << x;
    EXPECT_EQ(a < b, x < y);
  }
}

TEST(Scaled, APowerOfTwoMultipliesExactly) {
  std::mt19937_64 random(2);
  for (int n = 0; n < 10'000; ++n) {
    const Scaled a = any(random);
    const int power = static_cast<int>(random() % 20) - 10;
    EXPECT_EQ(real(a * Scaled(std::ldexp(1.0, power))), std::ldexp(real(a), power));
  }
}

TEST(Scaled, HoldsItsEndsAndZero) {
  EXPECT_EQ(real(Scaled(0)), 0);
  EXPECT_EQ(real(Scaled(0) * Scaled(5)), 0);
  EXPECT_EQ(real(Scaled(0) + Scaled(5)), 5);
  EXPECT_EQ(real(Scaled(5) - Scaled(5)), 0);
  EXPECT_EQ((Q<3, 27>(Scaled(100)).raw()), (Q<3, 27>::raw_limit));
  EXPECT_EQ((Q<3, 27>(Scaled(-100)).raw()), (-Q<3, 27>::raw_limit));
  EXPECT_EQ((ratio<Q<3, 27>>(Scaled(1), Scaled(0)).raw()), (Q<3, 27>::raw_limit));
  Scaled small(1e-200);
  for (int k = 0; k < 10; ++k) small = small * small + Scaled(0);
  EXPECT_EQ(real(small), 0);
}

}  // namespace
}  // namespace bms::arithmetic
