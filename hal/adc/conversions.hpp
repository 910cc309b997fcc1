// Conversions of the chip's own converter, which the readings of the DC link and of the Hall sensor share.
#pragma once

#include <cstdint>

#include "hal/adc.hpp"
#include "hal/adc/dc_link.hpp"

namespace bms::hal::adc {

/// Sum of n conversions, or 0 if one of them fails: no input that works has 0 counts.
inline std::uint32_t sum_of(AnalogInput input, std::uint32_t n) {
  std::uint32_t sum = 0;
  for (; n > 0; --n) {
    const auto counts = adc_convert(input);
    if (!counts) return 0;
    sum += *counts;
  }
  return sum;
}

/// Supply of the converter [uV], or 0. Starts the converter.
inline std::int32_t measured_supply_uv() {
  static constinit bool started = false;
  if (!started) adc_start();
  started = true;
  return supply_uv(sum_of(AnalogInput::reference, reference_conversions), adc_reference_at_3v3());
}

}  // namespace bms::hal::adc
