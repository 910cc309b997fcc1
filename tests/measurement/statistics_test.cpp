#include "measurement/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>

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

}  // namespace
}  // namespace bms::measurement
