#include "arithmetic/fixed.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "arithmetic/scalar.hpp"

namespace bms::arithmetic {
namespace {

using Narrow = Q<3, 28>;
using Wide = Q<1, 62>;
using Rounded = Q<10, 21>;

double real(auto q) { return static_cast<double>(q); }

TEST(Fixed, HoldsItsRangeAndSaturatesAtBothEnds) {
  EXPECT_EQ(real(Narrow(100.0)), real(Narrow::highest()));
  EXPECT_EQ(real(Narrow(-100.0)), -real(Narrow::highest()));
  EXPECT_EQ(Narrow(9).raw(), Narrow::raw_limit);
  EXPECT_EQ(Narrow(std::nan("")).raw(), 0);
  EXPECT_EQ(real(Current<FixedPoint>(Narrow(-7.5))), -7.5);
  EXPECT_EQ((Q<0, 31>(Narrow(-7.5)).raw()), (-Q<0, 31>::raw_limit));
}

TEST(Fixed, StoresToTheNearestStep) {
  using Coarse = Q<7, 2>;
  EXPECT_EQ(real(Coarse(Narrow(1.124))), 1.0);
  EXPECT_EQ(real(Coarse(Narrow(1.126))), 1.25);
  EXPECT_EQ(real(Coarse(Narrow(-1.124))), -1.0);
  EXPECT_EQ(real(Coarse(Narrow(-1.126))), -1.25);
}

TEST(Fixed, SumsAndProductsOfTheExtremesDoNotOverflow) {
  const Narrow most = Narrow::highest();
  EXPECT_NEAR(real(most + most), 16, 1e-8);
  EXPECT_NEAR(real(-most - most), -16, 1e-8);
  EXPECT_NEAR(real(most * most), 64, 1e-6);
  EXPECT_NEAR(real(-most * most), -64, 1e-6);
  const Wide widest = Wide::highest();
  EXPECT_NEAR(real(widest * most), 16, 1e-6);
  EXPECT_NEAR(real(-widest * most), -16, 1e-6);
  EXPECT_NEAR(real(widest + widest), 4, 1e-9);
}

TEST(Fixed, ArithmeticAgreesWithRealNumbersToAStepOfTheResult) {
  std::mt19937_64 random(1);
  for (int n = 0; n < 20'000; ++n) {
    const auto a = Narrow::from_raw(static_cast<std::int32_t>(random() >> 33) - (1 << 30));
    const auto b = Q<7, 24>::from_raw(static_cast<std::int32_t>(random() >> 33) - (1 << 30));
    const auto w = Wide::from_raw(static_cast<std::int64_t>(random() >> 1) - (std::int64_t{1} << 62));
    EXPECT_NEAR(real(a + b), real(a) + real(b), 0x1p-28);
    EXPECT_NEAR(real(a * b), real(a) * real(b), 0x1p-40);
    EXPECT_NEAR(real(product<Wide>(w, Q<1, 30>(b))), std::clamp(real(w) * real(Q<1, 30>(b)), -2.0, 2.0), 1e-15);
    EXPECT_EQ(a < b, real(a) < real(b));
    const double quotient = real(a) / real(b);
    // half a step; 30-bit mantissas: a product leaves out 2^32 of 2^58 and cuts 2^-29, a reciprocal is good to 2^-27
    EXPECT_NEAR(real(ratio<Rounded>(a, b)), std::clamp(quotient, -1'024.0, 1'024.0),
                0x1p-22 + std::abs(quotient) * (0x1p-26 + 0x1p-29 + 0x1p-27))
        << real(a) << " / " << real(b);
  }
}

TEST(Fixed, APowerOfTwoMultipliesExactlyUntilTheRangeEnds) {
  std::mt19937_64 random(3);
  for (int n = 0; n < 10'000; ++n) {
    const auto a = Narrow::from_raw(static_cast<std::int32_t>(random() >> 33) - (1 << 30));
    const PowerOfTwo p(static_cast<double>(1 << random() % 12));
    const double expected = real(a) * real(p), end = real(Narrow::highest());
    EXPECT_EQ(real(Narrow(a * p)), std::clamp(expected, -end, end)) << real(a) << " " << real(p);
    EXPECT_NEAR(real(Scaled(a * p)), expected, std::abs(expected) * 0x1p-29);
  }
  EXPECT_EQ(real(PowerOfTwo(2'047)), 1'024);
  EXPECT_EQ(real(PowerOfTwo(1)), 1);
}

TEST(Fixed, RatioOfTinyVariancesKeepsItsDigits) {
  const Wide small(3e-13), large(4e-12);
  EXPECT_NEAR(real(ratio<Q<1, 30>>(small, large)), real(small) / real(large), 0x1p-29);
  EXPECT_EQ(ratio<Narrow>(Narrow(1), Narrow(0)).raw(), Narrow::raw_limit);
  EXPECT_EQ(ratio<Narrow>(Narrow(-1), Narrow(0)).raw(), -Narrow::raw_limit);
  EXPECT_EQ(ratio<Narrow>(Narrow(0), Narrow(0)).raw(), 0);
}

TEST(Fixed, RootIsTrueToItsDigits) {
  std::mt19937_64 random(2);
  for (int n = 0; n < 5'000; ++n) {
    const auto w = Wide::from_raw(static_cast<std::int64_t>(random() >> (1 + random() % 60)));
    const double root_of = std::sqrt(real(w)), got = real(root<Narrow>(w));
    // half a step of the result; the operand's 63 bits cut to 30, half of 2^-29 in the root; of the correction 2^-28 is
    // lost, times y / 2 <= 1, of a root of at least 1/2: 2^-27, and in its other roundings 2^-28
    EXPECT_NEAR(got, root_of, 0x1p-29 + root_of * (0x1p-30 + 0x1p-27 + 0x1p-28)) << real(w);
  }
  EXPECT_EQ(root<Narrow>(Wide(-1)).raw(), 0);
}

TEST(Fixed, MicroUnitsBecomeAmperesAndVolts) {
  for (const std::int32_t micro : {0, 1, -1, 3'300'000, -2'000'000, 2'147'483'647, -2'147'483'647}) {
    EXPECT_NEAR(real(from_micro<Q<11, 20>>(micro)), std::clamp(micro * 1e-6, -2'048.0, 2'048.0), 1e-6) << micro;
    EXPECT_EQ(from_micro<double>(micro), micro * 1e-6);
  }
}

}  // namespace
}  // namespace bms::arithmetic
