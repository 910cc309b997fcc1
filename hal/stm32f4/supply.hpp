// Detector of a falling supply (RM0090, 5.2.3), and the option bytes that select the voltage of the brown-out reset
// (3.6.2, 3.9.6).
//
//   3.03 V (2.95 to 3.09)   detector, PLS 7, falling (3.14 V rising): the interrupt opens the contactors at once, then
//                           the firmware stores one record
//   2.83 V (2.75 to 2.90)   reset, if the option bytes select level 3; otherwise the reset comes below 2.7 V, where
//                           words of flash can no longer be programmed
//
// (datasheet DS8626, embedded reset and power control block characteristics)
#pragma once

namespace bms::hal::stm32f4 {

/// Call before the contactors' outputs are used.
void supply_start();

/// Returns true while the supply is below the detector's threshold.
bool supply_low();

/// Call in the handler of an interrupt of the most urgent priority: opens all contactors by the registers of the pins,
/// because main() may be in the middle of contactor_pins_set(). The outputs stay open until the firmware acknowledges
/// it like a fall of the supply (hal/supply.hpp).
void open_contactors();

/// Returns true if the option bytes select another level than 3.
bool brown_out_reset_low();

}  // namespace bms::hal::stm32f4
