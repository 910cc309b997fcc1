// What differs between ARMv6-M and ARMv7-M at start and at a fault. Back ends: armv6m, armv7m; board.cmake names one.
#pragma once

#include "hal/power.hpp"

namespace bms::hal::cortex_m {

/// Before anything else runs.
void start_core();

/// Fills in what the core's status registers say of a fault; `exception` is known.
void read_fault_status(FaultRecord& record);

}  // namespace bms::hal::cortex_m
