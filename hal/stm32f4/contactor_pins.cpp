// PC6 main plus, PC7 main minus, PC8 precharge, PC9 charge enable. A high level closes. All are open while the supply
// is low, and after a fall of it, a lost contact or a lost coil supply until the firmware has acknowledged it.
// Registers: RM0090, 8.4.
#include "hal/contactor_pins.hpp"

#include "hal/stm32f4/registers.hpp"
#include "hal/stm32f4/supply.hpp"
#include "hal/supply.hpp"

namespace bms::hal {

namespace {

bool on = false;  ///< the last call closes a contactor

bool forbidden() { return supply_falls() != 0 || contact_losses() != 0 || coil_losses() != 0; }

}  // namespace

void contactor_pins_set(const PowerPath& wanted) {
  using namespace stm32f4;
  std::uint32_t high = 0;
  if (!supply_low() && !forbidden()) {
    high = (wanted.main_plus ? 1U << 6 : 0U) | (wanted.main_minus ? 1U << 7 : 0U) | (wanted.precharge ? 1U << 8 : 0U) |
           (wanted.charge_enable ? 1U << 9 : 0U);
  }
  on = high != 0;
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 2;
  // First the level, then the output mode. Every call writes all registers, which repairs a disturbed one.
  gpioc_bsrr() = high | (~high & 15U << 6) << 16;
  if (forbidden()) gpioc_bsrr() = (15U << 6) << 16;  // an interrupt may have come since the check
  gpioc_otyper() = gpioc_otyper() & ~(15U << 6);
  gpioc_moder() = (gpioc_moder() & ~(255U << 12)) | 0x55U << 12;
}

bool contactor_pins_on() { return on; }

}  // namespace bms::hal
