// Time since boot. The firmware has no other clock.
#pragma once

#include <cstdint>

namespace bms::hal {

/// Sets the core to its full clock, or to the internal oscillator if the crystal fails, and starts counting.
void clock_start();

/// Microseconds since clock_start(); monotonic, does not wrap.
std::uint64_t now_us();

/// Core clock after clock_start() [Hz].
std::uint32_t core_clock_hz();

/// Sleeps until the next interrupt, at most 1 ms.
void wait_for_interrupt();

}  // namespace bms::hal
