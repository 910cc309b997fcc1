// Outputs that close the contactors. Back ends: stm32f4/ (PC6 to PC9).
#pragma once

#include "hal/power_path.hpp"

namespace bms::hal {

/// Before the first call, in reset and after it, pull-downs at the drivers keep all contactors open.
void contactor_pins_set(const PowerPath& wanted);

}  // namespace bms::hal
