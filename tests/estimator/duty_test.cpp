#include "tests/estimator/duty.hpp"

#include <gtest/gtest.h>

namespace bms::estimator {
namespace {

void expect_no_drift(const DutyFigures& f) {
  EXPECT_EQ(f.steps, 3'600'000U);
  EXPECT_TRUE(f.finite);
  EXPECT_EQ(f.subnormal, 0U);
  EXPECT_LT(f.rmse, 0.015);
  EXPECT_LT(f.largest, 0.08);  // in the middle of the plateau, after hours of a sensor that is off
  EXPECT_LT(f.rmse_last, 1.5 * f.rmse_first + 0.005) << "unbounded";
  EXPECT_LT(f.largest_sigma, 0.15);
  EXPECT_GT(f.inside, 0.9);
}

TEST(Duty, AThousandHoursDriftNowhere) { expect_no_drift(duty_as_in_the_file()); }

TEST(Duty, AThousandHoursWithErrorsAsStates) { expect_no_drift(duty_with_errors()); }

/// A year in 240 hours, -30 to 45 degrees C: two seeds, since the sensors' drift decides how wrong an hour gets.
TEST(Duty, FromColdStoreToSummer) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const DutyFigures f = duty_over_a_year(seed, 240);
    EXPECT_TRUE(f.finite);
    EXPECT_LT(f.rmse, 0.025) << seed;
    EXPECT_LT(f.largest, 0.12) << seed;
    EXPECT_GT(f.inside, 0.9) << seed;
  }
}

/// A cell file without temperature at -30 to -25 degrees C, where resistances are ten times those of the file: its
/// sigma has to contain what it does not know.
TEST(Duty, ACellFileWithoutTemperatureIsHonestInAColdStore) {
  double inside = 0;
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const DutyFigures f =
        duty<SocEstimator<float>>(tests::prepared<float>(), {}, {.winter_c = -30, .summer_c = -25}, seed, 48);
    EXPECT_LT(f.largest_sigma, 0.15) << seed;
    inside += f.inside / 3;
  }
  EXPECT_GT(inside, 0.9);
}

}  // namespace
}  // namespace bms::estimator
