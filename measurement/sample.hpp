// The one door for inputs: whatever can change an estimate is in a Sample, and what a Sample holds is what a log keeps.
//
// Integers in micro-units: a reading travels over CAN, through a file or from an ADC without a changed bit, a core
// without an FPU need not convert, and "no reading" is a value of its own instead of a NaN.
#pragma once

#include <cstdint>
#include <limits>

namespace bms::measurement {

inline constexpr std::int32_t no_reading = std::numeric_limits<std::int32_t>::min();
inline constexpr std::int16_t no_temperature = std::numeric_limits<std::int16_t>::min();

/// One set of measurements. Any field may lie (the estimator checks), none needs to be checked by the caller.
struct Sample {
  std::uint64_t time_us = 0;                        ///< since boot, or since the recording's zero
  std::int32_t current_ua = no_reading;             ///< mean since the previous sample, > 0 charges; +-2,147 A
  std::int32_t voltage_uv = no_reading;             ///< at time_us
  std::int16_t temperature_cdegc = no_temperature;  ///< hundredths of a degree Celsius
};

/// Whether a temperature can be one: -60 to 150 degrees C.
constexpr bool temperature_possible(std::int16_t cdegc) { return cdegc >= -6'000 && cdegc <= 15'000; }

/// What is known of the state of charge before the first sample, e.g. from the last run or from a user.
struct StartingPoint {
  std::int32_t soc_ppb = 0;        ///< 1e-9
  std::int32_t soc_sigma_ppb = 0;  ///< standard deviation, 1e-9
};

}  // namespace bms::measurement
