#include "measurement/thinned_recording.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace bms::measurement {
namespace {

/// One row a second, then one every seven seconds.
measurement::Recording uneven(std::size_t rows) {
  measurement::Recording r;
  double time_s = 5;
  for (std::size_t k = 0; k < rows; ++k) {
    r.time_s.edit().push_back(time_s);
    r.current_a.edit().push_back(std::sin(0.37 * static_cast<double>(k)) - 0.2);
    r.voltage_v.edit().push_back(k % 4 == 0 ? std::numeric_limits<double>::quiet_NaN() : 3.3);
    time_s += k < rows / 2 ? 1 : 7;
  }
  return r;
}

/// The current of a row flows since the row before.
double charge_as(const measurement::Recording& r) {
  double sum = 0;
  for (std::size_t k = 1; k < r.rows(); ++k) sum += r.current_a[k] * (r.time_s[k] - r.time_s[k - 1]);
  return sum;
}

TEST(ThinnedRecording, HasTheSameChargeAndDuration) {
  for (const std::size_t rows : {101U, 150U, 1'000U, 1'001U, 12'345U}) {
    const auto all = uneven(rows);
    const auto few = thinned(all, 100);
    EXPECT_LE(few.rows(), 101U) << rows;
    EXPECT_GT(few.rows(), 20U) << rows;
    EXPECT_NEAR(charge_as(few), charge_as(all), 1e-9 * static_cast<double>(rows)) << rows;
    EXPECT_EQ(few.time_s.front(), all.time_s.front());
    EXPECT_EQ(few.time_s.back(), all.time_s.back());
  }
  EXPECT_EQ(thinned(uneven(100), 100).rows(), 100U) << "short enough";
}

TEST(ThinnedRecording, AMissingReadingDoesNotSpoilTheMean) {
  auto all = uneven(1'000);
  all.current_a.edit()[500] = std::numeric_limits<double>::quiet_NaN();
  const auto few = thinned(all, 50);
  for (std::size_t k = 0; k < few.rows(); ++k) EXPECT_TRUE(std::isfinite(few.current_a[k])) << k;
  for (std::size_t k = 1; k < few.rows(); ++k) EXPECT_NEAR(few.voltage_v[k], 3.3, 1e-12) << k;
  for (double& v : all.voltage_v.edit()) v = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(thinned(all, 50).voltage_v[10])) << "nothing is known there";
  all.voltage_v.edit().clear();
  EXPECT_TRUE(thinned(all, 50).voltage_v.empty());
}

}  // namespace
}  // namespace bms::measurement
