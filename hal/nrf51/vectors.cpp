#include "hal/cortex_m/vectors.hpp"

#include "hal/nrf51/registers.hpp"

extern "C" {

void clock_interrupt();

// default handler for an image without a UART
[[gnu::weak, gnu::naked]] void uart_interrupt() { asm volatile("ldr r0, =fault_handler\n bx r0\n .ltorg"); }

}  // extern "C"

namespace bms::hal {

namespace {

constexpr std::size_t interrupts = 32;  // maximum of ARMv6-M

constexpr auto table() {
  auto all = cortex_m::fault_vectors<interrupts>();
  all.serve(cortex_m::core_exceptions + nrf51::timer_interrupt, clock_interrupt);
  all.serve(cortex_m::core_exceptions + nrf51::uart_interrupt, ::uart_interrupt);
  return all;
}

[[gnu::section(".vectors"), gnu::used]] constinit const auto vectors = table();

}  // namespace

}  // namespace bms::hal
