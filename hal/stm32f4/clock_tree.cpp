#include "hal/stm32f4/clock_tree.hpp"

#include "hal/stm32f4/registers.hpp"

namespace bms::hal::stm32f4 {

namespace {

constexpr Clocks internal_oscillator{16'000'000, 16'000'000};
constexpr Clocks crystal_and_pll{168'000'000, 84'000'000};
Clocks reached = internal_oscillator;

/// Some tens of milliseconds at 16 MHz. A crystal needs 2 ms (datasheet, table 40), the PLL 0.3 ms.
constexpr unsigned max_polls = 100'000;

bool wait_for(Register& reg, std::uint32_t mask, std::uint32_t value) {
  for (unsigned k = 0; k < max_polls; ++k) {
    if ((reg & mask) == value) return true;
  }
  return false;
}

}  // namespace

Clocks start_clocks() {
  constexpr std::uint32_t hse_on = 1U << 16, hse_ready = 1U << 17, security_on = 1U << 19, pll_on = 1U << 24,
                          pll_ready = 1U << 25;
  rcc_cr() = rcc_cr() | hse_on;
  if (!wait_for(rcc_cr(), hse_ready, hse_ready)) return reached;

  rcc_apb1enr() = rcc_apb1enr() | 1U << 28;  // power interface, then voltage scale 1, needed above 144 MHz
  pwr_cr() = pwr_cr() | 1U << 14;

  // 25 MHz / 25 * 336 / 2 = 168 MHz; / 7 = 48 MHz. Bit 29 is reserved and 1 after a reset.
  rcc_pllcfgr() = 25U | 336U << 6 | 0U << 16 | 1U << 22 | 7U << 24 | 1U << 29;
  rcc_cr() = rcc_cr() | pll_on;
  if (!wait_for(rcc_cr(), pll_ready, pll_ready)) return reached;

  flash_acr() = 5U | 1U << 8 | 1U << 9 | 1U << 10;  // 5 wait states, prefetch, both caches
  if (!wait_for(flash_acr(), 7U, 5U)) return reached;
  rcc_cfgr() = 5U << 10 | 4U << 13 | 2U;  // APB1 / 4, APB2 / 2, PLL as system clock
  if (!wait_for(rcc_cfgr(), 3U << 2, 2U << 2)) {
    rcc_cfgr() = 0;  // the internal oscillator, undivided, as in `reached`
    return reached;
  }
  rcc_cr() = rcc_cr() | security_on;  // a crystal that stops raises the NMI (7.2.7)
  return reached = crystal_and_pll;
}

void stop_clocks() {
  constexpr std::uint32_t pllcfgr_after_reset = 0x2400'3010, hse_security_and_pll_on = 1U << 16 | 1U << 19 | 1U << 24;
  rcc_cfgr() = 0;
  if (!wait_for(rcc_cfgr(), 3U << 2, 0)) return;
  rcc_cr() = rcc_cr() & ~hse_security_and_pll_on;
  if (!wait_for(rcc_cr(), 1U << 25, 0)) return;
  rcc_pllcfgr() = pllcfgr_after_reset;
  flash_acr() = 0;
  flash_acr() = 3U << 11;  // both caches are reset, which works only while they are off (3.9.1)
  flash_acr() = 0;
  reached = internal_oscillator;
}

const Clocks& clocks() { return reached; }

}  // namespace bms::hal::stm32f4
