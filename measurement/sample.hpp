// All measurements of a cell at one time: the only input of the estimator. Everything that can change an estimate is in
// a Sample, and a log stores whole samples, so a replay is exact.
//
// Integers in micro-units: a reading keeps its bits on CAN, in a file and from an ADC, a core without an FPU need not
// convert it, and "no reading" is a value of its own instead of a NaN.
#pragma once

#include <cstdint>
#include <limits>

namespace bms::measurement {

inline constexpr std::int32_t no_reading = std::numeric_limits<std::int32_t>::min();
inline constexpr std::int16_t no_temperature = std::numeric_limits<std::int16_t>::min();
/// No temperature either: the sensor is shorted, which a second line takes for the highest one.
inline constexpr std::int16_t shorted_thermistor = std::numeric_limits<std::int16_t>::max();

/// One set of measurements. Any field may be wrong: the estimator checks them, the caller need not.
struct Sample {
  std::uint64_t time_us = 0;                        ///< since start-up, or since time 0 of the recording
  std::int32_t current_ua = no_reading;             ///< mean since the previous sample, > 0 charges; +-2,147 A
  std::int32_t voltage_uv = no_reading;             ///< at time_us
  std::int16_t temperature_cdegc = no_temperature;  ///< hundredths of a degree Celsius
};

/// Returns true for -60 to 150 degrees C.
constexpr bool temperature_possible(std::int16_t cdegc) { return cdegc >= -6'000 && cdegc <= 15'000; }

/// State of charge before the first sample, from storage or from a user.
struct StartingPoint {
  std::int32_t soc_ppb = 0;        ///< 1e-9
  std::int32_t soc_sigma_ppb = 0;  ///< standard deviation, 1e-9
};

/// Capacity before the first sample, from storage, relative to the cell file. Default: nothing is known.
struct StartingCapacity {
  std::int32_t ratio_ppm = 1'000'000;  ///< 1e-6
  std::int32_t sigma_ppm = 100'000;    ///< standard deviation, 1e-6
};

}  // namespace bms::measurement
