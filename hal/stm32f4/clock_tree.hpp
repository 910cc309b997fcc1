// Clocks of the chip. Back ends: stm32f4/clock_tree (the chip itself), emulated/clock_tree.
#pragma once

#include <cstdint>

namespace bms::hal::stm32f4 {

struct Clocks {
  std::uint32_t core_hz;
  std::uint32_t apb2_hz;  ///< of USART1
};

/// On the crystal; what is derived from APB1 is good for CAN (0.5 %) then only.
inline constexpr std::uint32_t crystal_core_hz = 168'000'000, crystal_apb1_hz = 42'000'000;

/// 168 MHz from the 25 MHz crystal through the PLL; 16 MHz from the internal oscillator when crystal or PLL do not come
/// up.
Clocks start_clocks();

/// What start_clocks() has reached; the internal oscillator before.
const Clocks& clocks();

}  // namespace bms::hal::stm32f4
