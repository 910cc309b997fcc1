// Independent watchdog on its own 32 kHz oscillator (RM0090, 21).
#include "hal/watchdog.hpp"

#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

void watchdog_start(std::uint32_t timeout_ms) {
  stm32f4::iwdg_kr() = 0xCCCC;  // start
  stm32f4::iwdg_kr() = 0x5555;  // unlock
  stm32f4::iwdg_pr() = 4;       // 32 kHz / 64: one count is 2 ms
  stm32f4::iwdg_rlr() = timeout_ms / 2;
  watchdog_feed();
}

void watchdog_feed() { stm32f4::iwdg_kr() = 0xAAAA; }

}  // namespace bms::hal
