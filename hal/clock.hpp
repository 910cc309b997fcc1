// Time since boot. No other clock exists in the firmware.
#pragma once

#include <cstdint>

namespace bms::hal {

/// Brings the core to its full clock, or as far as it gets, and starts counting.
void clock_start();

/// Microseconds since clock_start(); never goes back, never wraps.
std::uint64_t now_us();

/// Core clock that was reached [Hz].
std::uint32_t core_clock_hz();

/// Sleeps until the next interrupt, a millisecond at most.
void wait_for_interrupt();

}  // namespace bms::hal
