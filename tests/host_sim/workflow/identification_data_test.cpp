// Which single voltages are left out of an identification, and which stay.
#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "workflow/identification_data.hpp"

namespace bms::workflow {
namespace {

constexpr std::size_t rows = 2'000, at_row = 1'015;  // under a constant current

/// Pulses of 400 s with a relaxation of 20 s, noise of 0.1 mV, read in digits.
measurement::Recording pulses(double digit_v) {
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 1e-4);
  std::vector<double> time_s, current_a, voltage_v;
  double rc_v = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double a = k / 400 % 2 == 0 ? -20 : 5;
    rc_v += -std::expm1(-1 / 20.0) * (0.002 * a - rc_v);
    const double v = 3.3 + 0.003 * a + rc_v - 2e-5 * static_cast<double>(k) + noise(random);
    time_s.push_back(static_cast<double>(k));
    current_a.push_back(a);
    voltage_v.push_back(digit_v > 0 ? digit_v * std::round(v / digit_v) : v);
  }
  measurement::Recording r;
  r.time_s = time_s;
  r.current_a = current_a;
  r.voltage_v = voltage_v;
  return r;
}

std::vector<std::size_t> left_out(measurement::Recording& r) {
  leave_out_odd_readings(r);
  std::vector<std::size_t> list;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    if (std::isnan(r.voltage_v[k])) list.push_back(k);
  }
  return list;
}

TEST(OddReadings, OneIsLeftOutFromFiveMillivoltsOn) {
  for (const double apart_v : {0.004, 0.006, 0.05, -0.004, -0.006, -0.05}) {
    measurement::Recording r = pulses(0);
    r.voltage_v.edit()[at_row] += apart_v;
    const bool odd = std::abs(apart_v) > 0.005;
    EXPECT_EQ(left_out(r), odd ? std::vector<std::size_t>{at_row} : std::vector<std::size_t>{}) << apart_v;
    EXPECT_EQ(r.warnings.size(), odd ? 1U : 0U) << apart_v;
  }
}

TEST(OddReadings, ACleanRecordingLosesNoRowHoweverCoarseItIs) {
  for (const double digit_v : {0.0, 0.001, 0.005, 0.01, 0.02}) {
    measurement::Recording r = pulses(digit_v);
    EXPECT_TRUE(left_out(r).empty()) << digit_v;
    EXPECT_TRUE(r.warnings.empty()) << digit_v;
  }
}

TEST(OddReadings, ManyAreNoise) {
  measurement::Recording r = pulses(0);
  for (std::size_t k = 5; k < rows; k += 40) r.voltage_v.edit()[k] += 0.05;
  EXPECT_TRUE(left_out(r).empty());
}

}  // namespace
}  // namespace bms::workflow
