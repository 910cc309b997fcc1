// A second current sensor, next to that of the samples. Back ends: adc/dc_link (a Hall sensor), absent/second_current.
#pragma once

#include <cstdint>

namespace bms::hal {

/// Current at the moment of the call [uA], > 0 charges; measurement::no_reading: not fitted, or not known yet. Call it
/// once per sample.
std::int32_t second_current_ua();

}  // namespace bms::hal
