// Resets the core if it is not fed in time. Once started, it cannot be stopped.
// Back ends: stm32f4/watchdog (the chip's independent watchdog), nrf51/watchdog, absent/watchdog (replay).
#pragma once

#include <cstdint>

namespace bms::hal {

/// timeout_ms: 1 to 8,000, measured by an oscillator with an error of up to 50 %.
void watchdog_start(std::uint32_t timeout_ms);
void watchdog_feed();

}  // namespace bms::hal
