#include "hal/stm32f4/supply.hpp"

#include "hal/stm32f4/registers.hpp"
#include "hal/supply.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t detector_on = 1U << 4, highest_level = 7U << 5, output = 1U << 2, line = 1U << 16,
                        brown_out_level = 3U << 2;

volatile bool fell = false;               ///< supply_failing() is due
volatile std::uint32_t falls = 0;         ///< written by the interrupt only
volatile std::uint32_t acknowledged = 0;  ///< written by main() only

}  // namespace

void supply_attend() {
  if (!fell) return;
  fell = false;
  supply_failing();
}

std::uint32_t supply_falls() { return falls - acknowledged; }
void supply_acknowledge(std::uint32_t known) { acknowledged = acknowledged + known; }

namespace stm32f4 {

void supply_start() {
  rcc_apb1enr() = rcc_apb1enr() | 1U << 28;
  pwr_cr() = (pwr_cr() & ~(7U << 5)) | highest_level | detector_on;
  exti_rtsr() = exti_rtsr() | line;  // the output rises when the supply falls
  exti_imr() = exti_imr() | line;
  nvic_iser0() = 1U << pvd_interrupt;
}

void open_contactors() {
  gpioc_bsrr() = 15U << 22;  // PC6 to PC9 low (hal/stm32f4/contactor_pins.cpp)
  falls = falls + 1;
}

bool supply_low() { return (pwr_csr() & output) != 0; }

bool brown_out_reset_low() { return (flash_optcr() & brown_out_level) != 0; }

}  // namespace stm32f4

}  // namespace bms::hal

extern "C" void pvd_interrupt() {
  using namespace bms::hal;
  stm32f4::exti_pr() = 1U << 16;
  stm32f4::open_contactors();
  fell = true;
}
