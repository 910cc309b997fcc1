// Clock tree of the chip. Back ends: stm32f4/clock_tree (the chip itself), emulated/clock_tree.
#pragma once

#include <cstdint>

namespace bms::hal::stm32f4 {

struct Clocks {
  std::uint32_t core_hz;
  std::uint32_t apb2_hz;  ///< clock of USART1
};

/// Clocks on the crystal. Only then is APB1 accurate enough for CAN (0.5 %).
inline constexpr std::uint32_t crystal_core_hz = 168'000'000, crystal_apb1_hz = 42'000'000;

/// Starts 168 MHz from the 25 MHz crystal through the PLL; stays at the 16 MHz of the internal oscillator if crystal or
/// PLL do not start.
Clocks start_clocks();

/// Back to the internal oscillator, as after a reset, for an image that starts the clocks itself.
void stop_clocks();

/// Result of start_clocks(); before it, the internal oscillator.
const Clocks& clocks();

}  // namespace bms::hal::stm32f4
