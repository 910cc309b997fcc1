// A second current sensor, to check the first one.
// Back ends: absent/second_current (not fitted).
#pragma once

#include <cstdint>

namespace bms::hal {

/// Current of the second sensor with the last sample [uA], > 0 charges; no_reading: not fitted, or not measured.
std::int32_t second_current_ua();

}  // namespace bms::hal
