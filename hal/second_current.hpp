// A second current sensor, next to that of the samples. Back ends: adc/second_current (a Hall sensor),
// absent/second_current.
#pragma once

#include <cstdint>

namespace bms::hal {

bool second_current_fitted();

/// Current at the moment of the call [uA], > 0 charges; measurement::no_reading: not fitted, not known yet, or
/// broken. Call it once per sample.
std::int32_t second_current_ua();

}  // namespace bms::hal
