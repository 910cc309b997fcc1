// The converter of the chip: one conversion after the other. Back ends: stm32f4/adc.
#pragma once

#include <cstdint>
#include <optional>

namespace bms::hal {

enum class AnalogInput : std::uint8_t { voltage, current, temperature, reference };

void adc_start();

/// 0 to 4,095; nothing when the converter does not get ready. 5 us, the reference 24 us; 50 us at most.
std::optional<std::uint16_t> adc_convert(AnalogInput input);

/// What the reference read at the maker's, at a supply of 3.3 V.
std::uint16_t adc_reference_at_3v3();

}  // namespace bms::hal
