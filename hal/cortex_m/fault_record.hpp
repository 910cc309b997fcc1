// The record that a fault leaves behind for the run after it; hal/power.hpp tells it.
#pragma once

#include "hal/power.hpp"

namespace bms::hal::cortex_m {

/// At start-up: what the last run has kept; forgotten for the next.
void read_stored_fault();

void store_fault(const FaultRecord& record);
[[noreturn]] void system_reset();

}  // namespace bms::hal::cortex_m
