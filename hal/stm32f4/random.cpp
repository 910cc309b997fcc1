// The random number generator (RM0090, 24). Its clock is the 48 MHz output of the PLL; on the internal oscillator alone
// it does not run, and each call returns 0.
#include "hal/random.hpp"

#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

constexpr std::uint32_t clock_enable = 1U << 6, generator_enable = 1U << 2;
constexpr std::uint32_t ready = 1U << 0, errors = 3U << 1;  // DRDY; CECS, SECS
constexpr int longest_wait = 1'000;                         // reads of the status; a word takes 40 cycles of 48 MHz

}  // namespace

std::uint32_t random_word() {
  rcc_ahb2enr() = rcc_ahb2enr() | clock_enable;
  rng_cr() = generator_enable;
  for (int k = 0; k < longest_wait; ++k) {
    const std::uint32_t status = rng_sr();
    if ((status & errors) != 0) return 0;
    if ((status & ready) != 0) return rng_dr();
  }
  return 0;
}

}  // namespace bms::hal
