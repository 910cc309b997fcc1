#include "hal/cortex_m/vectors.hpp"

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: has_second_bus
#include "hal/stm32f4/registers.hpp"

extern "C" {

void clock_interrupt();

// default handlers for an image without these peripherals
[[gnu::weak, gnu::naked]] void usart1_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void can1_tx_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void can1_rx0_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void can2_tx_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void can2_rx0_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void pvd_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void exti4_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void exti15_10_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::naked]] void tim5_interrupt() { asm volatile("b fault_handler"); }

/// NMI of the clock security system: the crystal has stopped. Opens the contactors (GPIOC_BSRR: PC6 to PC9 low) and
/// goes on as for a processor fault, whose record survives the reset. The next start finds out whether the crystal
/// works again; the contactors stay open until the fault is cleared.
[[gnu::naked]] void clock_failure_interrupt() {
  asm volatile(
      "ldr r0, =0x40020818\n"
      "mov r1, #0x03C00000\n"
      "str r1, [r0]\n"
      "b fault_handler\n"
      ".ltorg\n");
}

}  // extern "C"

namespace bms::hal {

namespace {

constexpr std::size_t interrupts = 82;  // RM0090, table 61

constexpr auto table() {
  auto all = cortex_m::fault_vectors<interrupts>();
  all.serve(cortex_m::systick, clock_interrupt);
  all.serve(cortex_m::nmi, clock_failure_interrupt);
  all.serve(cortex_m::core_exceptions + stm32f4::usart1_interrupt, ::usart1_interrupt);
  all.serve(cortex_m::core_exceptions + stm32f4::can1_tx_interrupt, ::can1_tx_interrupt);
  all.serve(cortex_m::core_exceptions + stm32f4::can1_rx0_interrupt, ::can1_rx0_interrupt);
  if constexpr (has_second_bus) {
    all.serve(cortex_m::core_exceptions + stm32f4::can2_tx_interrupt, ::can2_tx_interrupt);
    all.serve(cortex_m::core_exceptions + stm32f4::can2_rx0_interrupt, ::can2_rx0_interrupt);
  }
  all.serve(cortex_m::core_exceptions + stm32f4::pvd_interrupt, ::pvd_interrupt);
  all.serve(cortex_m::core_exceptions + stm32f4::exti4_interrupt, ::exti4_interrupt);
  all.serve(cortex_m::core_exceptions + stm32f4::exti15_10_interrupt, ::exti15_10_interrupt);
  all.serve(cortex_m::core_exceptions + stm32f4::tim5_interrupt, ::tim5_interrupt);
  return all;
}

[[gnu::section(".vectors"), gnu::used]] constinit const auto vectors = table();

}  // namespace

}  // namespace bms::hal
