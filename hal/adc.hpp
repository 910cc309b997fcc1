// The chip's own analog-to-digital converter, one conversion per call. Back ends: stm32f4/adc.
#pragma once

#include <cstdint>
#include <optional>

namespace bms::hal {

enum class AnalogInput : std::uint8_t {
  voltage,
  current,
  temperature,
  reference,
  link_plus,  ///< divider of the DC link at main plus
  link_minus,
};

/// Configures pins and converter and waits until it is stable, 11 us. Call once, after clock_start().
void adc_start();

/// Returns 0 to 4,095, or nothing if the conversion does not finish. Takes 5 us, for the reference 24 us, at most 50
/// us.
std::optional<std::uint16_t> adc_convert(AnalogInput input);

/// Counts of the internal reference at a supply of 3.3 V, as the manufacturer measured them on this chip.
std::uint16_t adc_reference_at_3v3();

}  // namespace bms::hal
