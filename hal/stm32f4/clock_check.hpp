// Supervision of the clock while the firmware runs. Three parts, each independent of the others:
//
//   crystal stops        clock security system (RM0090, 7.2.7): the core continues on the internal oscillator, and the
//                        NMI opens the contactors, records a fault and resets the core (hal/stm32f4/vectors.cpp)
//   wrong frequency      timer 5 measures eight periods of a slow oscillator (7.2.11, 18.4.20): of the 32,768 Hz
//                        crystal, if it runs, to 1 %; otherwise of the internal one, 17 to 47 kHz (datasheet DS8626),
//                        which finds a core below 0.36 and above 2.8 times its frequency for every oscillator. Eight
//                        wrong measurements in a row open the contactors: 1.4 to 3.8 ms. The slow oscillator raises the
//                        interrupt, so this time does not depend on the core's clock.
//   core stands still    independent watchdog (hal/stm32f4/watchdog.cpp)
//
// Back ends: stm32f4/clock_check (the chip itself), emulated/clock_check (none).
#pragma once

namespace bms::hal::stm32f4 {

/// Call once, after start_clocks(). Does nothing while the core runs on the internal oscillator.
void clock_check_start();

/// Call with every sample. Returns true from the first wrong frequency until the next reset, also if both slow
/// oscillators stand still.
bool clock_wrong();

}  // namespace bms::hal::stm32f4
