// Correction of a board's own measuring chain, determined with a meter and stored with the settings
// (firmware/stored_state.hpp). Back ends: adc/samples, absent/calibration (a factory-calibrated chip, or another node
// measures).
#pragma once

#include <cstdint>

namespace bms::hal {

/// corrected = reading * (1 + gain) + offset
struct SensorCalibration {
  std::int32_t voltage_gain_ppm = 0, voltage_offset_uv = 0, current_gain_ppm = 0, current_offset_ua = 0;
};

/// Call before the first sample and after each change.
void calibrate(const SensorCalibration& calibration);

}  // namespace bms::hal
