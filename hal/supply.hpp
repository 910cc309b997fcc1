// Falling supply voltage: the firmware stores its data while the supply still lasts. Back ends: stm32f4/supply,
// absent/supply (the supply is not monitored).
#pragma once

namespace bms::hal {

/// Calls supply_failing() once after each fall of the supply. Call it wherever main() waits.
void supply_attend();

/// Defined by the firmware (firmware/main.cpp): stores one record, which takes 0.2 ms, at most 1.2 ms. It is called by
/// name, not through a pointer, so that the stack depth can be computed from the image.
void supply_failing();

}  // namespace bms::hal
