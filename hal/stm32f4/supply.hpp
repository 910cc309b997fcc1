// The detector of a supply that sinks (RM0090, 5.2.3), and the option bytes that say when the chip resets itself for it
// (3.6.2, 3.9.6).
//
//   3.03 V (2.95 to 3.09)   the detector, PLS 7, falling; 3.14 V rising: contactors open at once, in the interrupt;
//   then one record is kept 2.83 V (2.75 to 2.90)   reset, if the option bytes say level 3; else at a voltage at which
//   words of flash are not programmed any more (2.7 V)
//
// (datasheet DS8626, embedded reset and power control block characteristics)
#pragma once

namespace bms::hal::stm32f4 {

/// After the contactors' outputs may be used.
void supply_start();

/// Below the threshold now.
bool supply_low();

/// Option bytes: any level but 3.
bool brown_out_reset_low();

}  // namespace bms::hal::stm32f4
