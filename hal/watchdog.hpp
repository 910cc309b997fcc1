// Resets the core when it is not fed in time. Once started it cannot be stopped.
#pragma once

#include <cstdint>

namespace bms::hal {

/// timeout_ms: 1..8,000.
void watchdog_start(std::uint32_t timeout_ms);
void watchdog_feed();

}  // namespace bms::hal
