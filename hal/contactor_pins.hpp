// The outputs that close contactors. Back ends: stm32f4/ (PC6 to PC9).
#pragma once

#include "hal/power_path.hpp"

namespace bms::hal {

/// All open before the first call, in reset and after it: pull-downs at the drivers.
void contactor_pins_set(const PowerPath& wanted);

}  // namespace bms::hal
