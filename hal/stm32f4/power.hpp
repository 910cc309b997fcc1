// What start-up and fault handlers need of power.cpp.
#pragma once

#include "hal/power.hpp"

namespace bms::hal::stm32f4 {

void read_reset_cause();
void keep(const FaultRecord& record);
[[noreturn]] void system_reset();

}  // namespace bms::hal::stm32f4
