// Correction of a board's own measuring chain, determined with a meter and stored with the settings
// (firmware/stored_state.hpp). Back ends: adc/samples, bq76952/samples, absent/calibration (another node measures).
#pragma once

#include <cstdint>

namespace bms::hal {

/// corrected = reading * (1 + gain) + offset. The voltage is that of a cell.
struct SensorCalibration {
  std::int32_t voltage_gain_ppm = 0, voltage_offset_uv = 0, current_gain_ppm = 0, current_offset_ua = 0;

  constexpr bool operator==(const SensorCalibration&) const = default;
};

/// reading * (1 + gain) + offset, rounded.
constexpr std::int64_t corrected(std::int64_t reading, std::int32_t gain_ppm, std::int64_t offset) {
  const std::int64_t more = reading * gain_ppm;
  return reading + (more >= 0 ? more + 500'000 : more - 500'000) / 1'000'000 + offset;
}

/// Call before the first sample and after each change. Returns false if this back end cannot correct its readings; then
/// they stay as they are.
bool calibrate(const SensorCalibration& calibration);

}  // namespace bms::hal
