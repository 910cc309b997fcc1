// From reset to main(): vector table, FPU, .data and .bss, constructors; and the handlers of faults, which record what the core
// saw and reset it (a fault handler that stops would leave contactors as they are until the watchdog bites).
#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/stm32f4/power.hpp"
#include "hal/stm32f4/registers.hpp"

extern "C" {

// from the linker script
extern std::uint32_t image_vectors[], image_data_load[], image_data_begin[], image_data_end[], image_bss_begin[], image_bss_end[], image_stack_top[], image_ram_begin[];
extern void (*image_constructors_begin[])();
extern void (*image_constructors_end[])();

int main();
void systick_interrupt();

[[noreturn]] void reset_handler() {
  using namespace bms::hal::stm32f4;
  scb_cpacr() = scb_cpacr() | 15U << 20;  // FPU, before anything can use it
  scb_vtor() = reinterpret_cast<std::uint32_t>(image_vectors);  // flash is at 0 too, unless the boot pins say otherwise
  asm volatile("dsb\n isb" ::: "memory");
  for (std::uint32_t *from = image_data_load, *to = image_data_begin; to < image_data_end;) *to++ = *from++;
  for (std::uint32_t* to = image_bss_begin; to < image_bss_end;) *to++ = 0;
  scb_shcsr() = scb_shcsr() | 7U << 16;  // memory, bus and usage faults under their own name
  read_reset_cause();
  for (auto construct = image_constructors_begin; construct < image_constructors_end; ++construct) (*construct)();
  bms::hal::finish(main());
}

/// frame: r0-r3, r12, lr, pc, psr as the core stacked them (ARMv7-M, B1.5.6).
[[noreturn, gnu::used]] void record_fault(const std::uint32_t* frame) {
  using namespace bms::hal;
  FaultRecord record;
  record.exception = stm32f4::scb_icsr() & 511U;
  record.cfsr = stm32f4::scb_cfsr();
  record.hfsr = stm32f4::scb_hfsr();
  record.address = (record.cfsr & 1U << 7) != 0 ? stm32f4::scb_mmfar() : stm32f4::scb_bfar();
  const auto at = reinterpret_cast<std::uintptr_t>(frame), ram = reinterpret_cast<std::uintptr_t>(image_ram_begin), top = reinterpret_cast<std::uintptr_t>(image_stack_top);
  if (at >= ram && at <= top - 8 * sizeof *frame) {  // else the stack itself was the fault
    record.lr = frame[5];
    record.pc = frame[6];
    record.psr = frame[7];
  }
  stm32f4::keep(record);
  stm32f4::system_reset();
}

/// Takes the stacked frame, then a fresh stack: the old one may be what failed.
[[gnu::naked]] void fault_handler() {
  asm volatile(
      "tst lr, #4\n"
      "ite eq\n"
      "mrseq r0, msp\n"
      "mrsne r0, psp\n"
      "ldr r1, =image_stack_top\n"
      "msr msp, r1\n"
      "b record_fault\n");
}

// an image without a UART or CAN does not serve its interrupt
[[gnu::weak, gnu::naked]] void usart1_interrupt() { asm volatile("b fault_handler"); }
[[gnu::weak, gnu::alias("fault_handler")]] void can1_tx_interrupt() noexcept;
[[gnu::weak, gnu::alias("fault_handler")]] void can1_rx0_interrupt() noexcept;

}  // extern "C"

namespace {

using Handler = void (*)();
constexpr std::size_t core_exceptions = 16, interrupts = 82;  // RM0090, table 61

struct VectorTable {
  std::uint32_t* stack;
  std::array<Handler, core_exceptions - 1 + interrupts> handlers;
};

constexpr std::array<Handler, core_exceptions - 1 + interrupts> handlers() {
  std::array<Handler, core_exceptions - 1 + interrupts> all{};
  for (Handler& handler : all) handler = fault_handler;
  all[1 - 1] = reset_handler;
  all[15 - 1] = systick_interrupt;
  all[core_exceptions - 1 + bms::hal::stm32f4::usart1_interrupt] = ::usart1_interrupt;
  all[core_exceptions - 1 + bms::hal::stm32f4::can1_tx_interrupt] = ::can1_tx_interrupt;
  all[core_exceptions - 1 + bms::hal::stm32f4::can1_rx0_interrupt] = ::can1_rx0_interrupt;
  return all;
}

[[gnu::section(".vectors"), gnu::used]] constinit const VectorTable vectors{image_stack_top, handlers()};

}  // namespace
