#include "measurement/recording.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace bms::measurement {
namespace {

TEST(Recording, SamplesAreInMicroUnitsFromTheFirstRowAndMarkMissingReadings) {
  Recording r;
  r.time_s = {100.5, 101.5000004, 103};
  r.current_a = {-1.2345678, std::nan(""), 5'000};
  r.voltage_v = {3.2, std::nan(""), -9'999};
  r.temperature_c = {-12.34, std::nan(""), 1e6};
  const auto s = samples(r);
  EXPECT_EQ(s[0].time_us, 0U);
  EXPECT_EQ(s[1].time_us, 1'000'000U);
  EXPECT_EQ(s[0].current_ua, -1'234'568);
  EXPECT_EQ(s[1].current_ua, no_reading);
  EXPECT_EQ(s[2].current_ua, 2'147'483'647) << "saturates, and is implausible";
  EXPECT_EQ(s[1].voltage_uv, no_reading);
  EXPECT_EQ(s[2].voltage_uv, -2'147'483'647) << "not the value that means missing";
  EXPECT_EQ(s[0].temperature_cdegc, -1'234);
  EXPECT_EQ(s[1].temperature_cdegc, no_temperature);
}

}  // namespace
}  // namespace bms::measurement
