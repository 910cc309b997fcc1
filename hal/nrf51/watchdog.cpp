// Watchdog on the 32,768 Hz oscillator, which it starts itself.
#include "hal/watchdog.hpp"

#include "hal/nrf51/registers.hpp"

namespace bms::hal {

void watchdog_start(std::uint32_t timeout_ms) {
  nrf51::wdt_crv() = timeout_ms * 32'768 / 1'000;
  nrf51::wdt_rren() = 1;  // one feed register
  nrf51::wdt_start() = 1;
}

void watchdog_feed() { nrf51::wdt_rr0() = 0x6E524635; }

}  // namespace bms::hal
