// Inputs of the truck, high when on: PC2 key, PC3 charger plug, PC4 coil supply, PC5 interlock loop, PC13 crash or tilt
// sensor (closed unless it has detected one). Outputs, high when on: PC10 heater, PC11 fan, PC12 SOC lamp. Pull-downs
// at the pins, so a broken wire is off. Wiring: boards/stm32f405_forklift/README.md.
//
// EXTI4 (RM0090, 12.2): the coil supply falls while an output is on. All outputs open, so that contactors that dropped
// out do not close again with the supply, without precharge.
#include "hal/contactor_pins.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/truck_inputs.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

constexpr std::uint32_t coil_line = 1U << 4, contactors = 15U << 6;
constexpr unsigned first_output = 10;
constexpr bool watches_coils = (fitted_inputs & static_cast<std::uint32_t>(TruckInput::coil_supply)) != 0;

volatile std::uint32_t losses = 0;        ///< written by the interrupt only
volatile std::uint32_t acknowledged = 0;  ///< written by main() only
bool started = false;

void start() {
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 2;
  constexpr std::uint32_t pins = 255U << 4 | 3U << 26;
  gpioc_moder() = gpioc_moder() & ~pins;                            // inputs
  gpioc_pupdr() = (gpioc_pupdr() & ~pins) | (0xAAAA'AAAAU & pins);  // pull-downs
  if (!watches_coils) return;
  rcc_apb2enr() = rcc_apb2enr() | 1U << 14;           // SYSCFG
  syscfg_exticr2() = (syscfg_exticr2() & ~15U) | 2U;  // port C
  exti_ftsr() = exti_ftsr() | coil_line;
  exti_pr() = coil_line;
  exti_imr() = exti_imr() | coil_line;
  nvic_iser0() = 1U << exti4_interrupt;
}

}  // namespace

TruckInputs truck_inputs() {
  if (!started) start();
  started = true;
  const std::uint32_t on = (gpioc_idr() >> 2 & 15U) | (gpioc_idr() >> 13 & 1U) << 4;
  return {fitted_inputs, on, coil_losses()};
}

void acknowledge_coil_losses(std::uint32_t known) { acknowledged = acknowledged + known; }
std::uint32_t coil_losses() { return losses - acknowledged; }

void truck_outputs_set(std::uint32_t outputs) {
  constexpr std::uint32_t all = fitted_outputs << first_output;
  const std::uint32_t high = outputs << first_output & all;
  gpioc_bsrr() = high | (~high & all) << 16;
  for (unsigned pin = first_output; pin < first_output + 3; ++pin) {
    if ((all >> pin & 1) != 0) gpioc_moder() = (gpioc_moder() & ~(3U << 2 * pin)) | 1U << 2 * pin;
  }
}

}  // namespace bms::hal

/// Opens all contactors. It writes the register itself, because main() may be in the middle of contactor_pins_set().
extern "C" void exti4_interrupt() {
  using namespace bms::hal;
  exti_pr() = coil_line;
  if ((gpioc_odr() & contactors) == 0) return;
  gpioc_bsrr() = contactors << 16;
  losses = losses + 1;
}
