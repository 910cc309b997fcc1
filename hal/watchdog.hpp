// Resets the core when it is not fed in time. Once started it cannot be stopped.
// Back ends: stm32f4/watchdog (the chip's independent one), absent/watchdog (replay).
#pragma once

#include <cstdint>

namespace bms::hal {

/// timeout_ms: 1..8,000, by an oscillator that may be off by half either way.
void watchdog_start(std::uint32_t timeout_ms);
void watchdog_feed();

}  // namespace bms::hal
