// Falling supply voltage: the firmware stores its data while the supply still lasts. Back ends: stm32f4/supply,
// absent/supply (the supply is not monitored).
//
// The detector's interrupt opens the contactors by itself. A dip can be over before the next sample, so it is counted:
// the outputs stay open until the firmware has acknowledged every fall.
#pragma once

#include <cstdint>

namespace bms::hal {

/// Calls supply_failing() once after each fall of the supply. Call it wherever main() waits.
void supply_attend();

/// Number of falls of the supply that have not been acknowledged.
std::uint32_t supply_falls();

/// Allows outputs to close again. Call with the number that protection has received, after it has opened all outputs.
void supply_acknowledge(std::uint32_t falls);

/// Defined by the firmware (firmware/main.cpp): stores one record, which takes 0.2 ms, at most 1.2 ms. It is called by
/// name, not through a pointer, so that the stack depth can be computed from the image.
void supply_failing();

}  // namespace bms::hal
