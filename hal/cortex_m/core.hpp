// Differences between ARMv6-M and ARMv7-M at start and at a fault. Back ends: armv6m, armv7m; chip.cmake selects one.
#pragma once

#include "hal/power.hpp"

namespace bms::hal::cortex_m {

/// Call before any other code runs.
void start_core();

/// Adds the core's fault status registers to `record`, whose `exception` is set.
void read_fault_status(FaultRecord& record);

}  // namespace bms::hal::cortex_m
