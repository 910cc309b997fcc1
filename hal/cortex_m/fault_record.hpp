// Record of a processor fault, which survives the reset and which last_fault() of hal/power.hpp returns.
#pragma once

#include "hal/power.hpp"

namespace bms::hal::cortex_m {

/// Call at start-up. Reads the record of the last run and deletes it.
void read_stored_fault();

void store_fault(const FaultRecord& record);
[[noreturn]] void system_reset();

}  // namespace bms::hal::cortex_m
