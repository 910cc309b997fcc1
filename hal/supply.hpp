// A supply that sinks: what is to be kept is kept while there is still some. Back ends: stm32f4/supply; absent/supply
// (nobody watches it).
#pragma once

namespace bms::hal {

/// Wherever main() waits.
void supply_attend();

/// The firmware's own (firmware/main.cpp): called by supply_attend() once each time the supply has fallen below its
/// threshold; no longer than one record takes, 0.2 ms, 1.2 at most. A function by name, not by pointer: how deep the
/// stack gets is read from the image.
void supply_failing();

}  // namespace bms::hal
