// Independent watchdog on its own oscillator of 32 kHz, 17 to 47 kHz (RM0090, 21; datasheet DS8626). A timeout of 2 s
// is therefore 1.36 to 3.77 s.
#include "hal/watchdog.hpp"

#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

constexpr unsigned max_polls = 50'000;  // 1 ms at 4 cycles each, at 168 MHz

}  // namespace

void watchdog_start(std::uint32_t timeout_ms) {
  stm32f4::iwdg_kr() = 0xCCCC;  // start
  stm32f4::iwdg_kr() = 0x5555;  // unlock
  stm32f4::iwdg_pr() = 4;       // 32 kHz / 64: one count is 2 ms
  stm32f4::iwdg_rlr() = timeout_ms / 2;
  // Both values take five cycles of 17 kHz, 0.3 ms. A feed before that loads the old value, which lasts for 8 s.
  for (unsigned k = 0; k < max_polls && stm32f4::iwdg_sr() != 0; ++k) continue;
  watchdog_feed();
}

void watchdog_feed() { stm32f4::iwdg_kr() = 0xAAAA; }

}  // namespace bms::hal
