// What a board's own measuring chain is corrected by: measured against a meter, kept with the settings
// (firmware/stored_state.hpp). Back ends: adc/samples; absent/calibration (a chip that comes calibrated, or another
// node measures).
#pragma once

#include <cstdint>

namespace bms::hal {

/// corrected = read * (1 + gain) + offset
struct SensorCalibration {
  std::int32_t voltage_gain_ppm = 0, voltage_offset_uv = 0, current_gain_ppm = 0, current_offset_ua = 0;
};

/// Before the first sample, and whenever it is changed.
void calibrate(const SensorCalibration& calibration);

}  // namespace bms::hal
