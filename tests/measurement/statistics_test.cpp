#include "measurement/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "measurement/normal_distribution.hpp"

namespace bms::measurement {
namespace {

const double missing = std::nan("");

TEST(Statistics, TheMedianOfAnEvenNumberOfValuesIsTheMeanOfTheTwoInTheMiddle) {
  EXPECT_EQ(median<double>({4, 1, 2}), 2);
  EXPECT_EQ(median<double>({8, 1, 2, 4}), 3);
  EXPECT_EQ(upper_median<double>({8, 1, 2, 4}), 4);
}

TEST(Statistics, AQuantileIsOneOfTheValues) {
  const std::vector<double> values = {9, 8, 7, 6, 5, 4, 3, 2, 1, 0};
  EXPECT_EQ(quantile(values, 0), 0);
  EXPECT_EQ(quantile(values, 0.2), 2);
  EXPECT_EQ(quantile(values, 0.99), 9);
}

TEST(Statistics, TheRmsIsTheRootOfTheMeanSquare) { EXPECT_EQ(rms(std::vector<double>{3, -4, 0, 0}), 2.5); }

TEST(Statistics, MissingValuesAreLeftOut) {
  EXPECT_EQ(median<double>({missing, 1, 3}), 2);
  EXPECT_EQ(upper_median<double>({5, missing, 1}), 5);
  EXPECT_EQ(rms(std::vector<double>{missing, 2}), 2);
}

TEST(Statistics, WithoutValuesThereIsNoMedianAndTheRmsIsZero) {
  EXPECT_TRUE(std::isnan(median<double>({})));
  EXPECT_TRUE(std::isnan(quantile<double>({missing}, 0.5)));
  EXPECT_EQ(rms({}), 0);
}

TEST(NormalDistribution, HasTheValuesOfItsTables) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959964, 1e-6);
  EXPECT_NEAR(normal_quantile(0.01), -2.326348, 1e-6);
  EXPECT_NEAR(normal_quantile(0.5), 0, 1e-9);
  EXPECT_NEAR(normal_quantile(1e-9), -5.997807, 1e-6);
  EXPECT_NEAR(normal_quantile(1 - 1e-9), 5.997807, 1e-6);
  EXPECT_NEAR(normal_tail(1.281552), 0.1, 1e-6);
  EXPECT_NEAR(normal_tail(-2), 0.977250, 1e-6);
}

}  // namespace
}  // namespace bms::measurement
