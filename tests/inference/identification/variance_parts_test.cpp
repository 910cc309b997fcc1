#include "identification/variance_parts.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

namespace bms::identification {
namespace {

TEST(VarianceParts, AreFoundExactlyWhereTheErrorsFollowThem) {
  const std::array by{0.01, 0.03, 0.1, 0.2};
  std::array<double, 4> rms{};
  for (std::size_t k = 0; k < by.size(); ++k) rms[k] = std::hypot(0.004, 0.15 * by[k]);
  const VarianceParts parts = variance_parts(rms, by);
  EXPECT_NEAR(parts.constant, 0.004, 1e-6);
  EXPECT_NEAR(parts.per, 0.15, 1e-6);
}

TEST(VarianceParts, OneSetOrEqualSizesLeaveAllConstant) {
  EXPECT_NEAR(variance_parts(std::array{0.01}, std::array{0.2}).constant, 0.01, 1e-12);
  const VarianceParts equal = variance_parts(std::array{0.003, 0.004}, std::array{0.1, 0.1});
  EXPECT_NEAR(equal.constant, std::sqrt((9e-6 + 16e-6) / 2), 1e-12);
  EXPECT_EQ(equal.per, 0);
}

TEST(VarianceParts, AreNeverNegative) {
  const VarianceParts falling = variance_parts(std::array{0.02, 0.005}, std::array{0.01, 0.3});
  EXPECT_EQ(falling.per, 0);
  EXPECT_GT(falling.constant, 0.004);
  const VarianceParts proportional = variance_parts(std::array{0.001, 0.02}, std::array{0.01, 0.1});
  EXPECT_EQ(proportional.constant, 0);
  EXPECT_GT(proportional.per, 0.09);
}

/// A mean of squares would find 15 mV here; the coldest recording must not decide for all others.
TEST(VarianceParts, OneLargeErrorDoesNotDecideForAll) {
  std::vector<double> rms, by;
  std::mt19937 random(3);
  std::normal_distribution<double> spread(0, 0.2);
  for (int k = 0; k < 200; ++k) {
    by.push_back(k % 8 == 0 ? 0.3 : 0.02);
    rms.push_back(std::hypot(0.004, 0.15 * by.back()) * std::exp(spread(random)));
  }
  const VarianceParts parts = variance_parts(rms, by);
  EXPECT_NEAR(parts.constant, 0.004, 0.0005);
  EXPECT_NEAR(parts.per, 0.15, 0.03);
}

}  // namespace
}  // namespace bms::identification
