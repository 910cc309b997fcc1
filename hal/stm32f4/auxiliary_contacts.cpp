// PB14 auxiliary contact of main plus, PB15 of main minus: low when the main contact is closed; pull-ups.
//
// EXTI14 and EXTI15 (RM0090, 12.2): a contact that opens while its output (PC6, PC7) is on opens all outputs. The
// interrupt counts only contacts that a sample has seen closed, so not the bouncing of a closing, and only while the
// output is on, so not an opening by the firmware or by the detector of the supply.
#include "hal/contactor_pins.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t lines = 3U << 14;

volatile std::uint32_t watched = 0;       ///< bits 14 and 15; written by main() only
volatile std::uint32_t losses = 0;        ///< written by the interrupt only
volatile std::uint32_t acknowledged = 0;  ///< written by main() only
bool started = false;

/// Bits 14 and 15 of contacts whose outputs are on.
std::uint32_t commanded() { return stm32f4::gpioc_odr() << 8 & lines; }
std::uint32_t closed() { return ~stm32f4::gpiob_idr() & lines; }

void start() {
  using namespace stm32f4;
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 1 | 1U << 2;
  rcc_apb2enr() = rcc_apb2enr() | 1U << 14;                                   // SYSCFG
  gpiob_moder() = gpiob_moder() & ~(15U << 28);                               // inputs
  gpiob_pupdr() = (gpiob_pupdr() & ~(15U << 28)) | 5U << 28;                  // pull-ups
  syscfg_exticr4() = (syscfg_exticr4() & ~(255U << 8)) | 1U << 8 | 1U << 12;  // port B
  exti_rtsr() = exti_rtsr() | lines;
  exti_pr() = lines;
  exti_imr() = exti_imr() | lines;
  nvic_iser1() = 1U << (exti15_10_interrupt - 32);
}

}  // namespace

AuxiliaryContacts auxiliary_contacts() {
  if (!started) start();
  started = true;
  const std::uint32_t now = closed(), on = commanded();
  watched = on & (watched | now);
  return {true, (now & 1U << 14) != 0, (now & 1U << 15) != 0, losses - acknowledged};
}

void acknowledge_contact_losses(std::uint32_t known) { acknowledged = acknowledged + known; }

std::uint32_t contact_losses() { return losses - acknowledged; }

}  // namespace bms::hal

/// Opens all contactors. It writes the register itself, because main() may be in the middle of contactor_pins_set().
extern "C" void exti15_10_interrupt() {
  using namespace bms::hal;
  stm32f4::exti_pr() = lines;
  if ((watched & commanded() & ~closed()) == 0) return;
  stm32f4::gpioc_bsrr() = 15U << 22;  // PC6 to PC9 low (hal/stm32f4/contactor_pins.cpp)
  losses = losses + 1;
}
