// From reset to main(): core, .data, .bss and constructors. The fault handler records the state of the core and resets
// it; a handler that stops would leave the contactors as they are until the watchdog resets the core.
#include <cstdint>

#include "hal/cortex_m/core.hpp"
#include "hal/cortex_m/fault_record.hpp"
#include "hal/cortex_m/ram_test.hpp"
#include "hal/cortex_m/registers.hpp"
#include "hal/cortex_m/stack.hpp"
#include "hal/cortex_m/startup.hpp"
#include "hal/cortex_m/vectors.hpp"

namespace {

bool ram_good = true;

}  // namespace

bool bms::hal::cortex_m::ram_failed() { return !ram_good; }

extern "C" {

// defined by the linker script
extern std::uint32_t image_data_load[], image_data_begin[], image_data_end[], image_bss_begin[], image_bss_end[];
extern void (*image_constructors_begin[])();
extern void (*image_constructors_end[])();

int main();

/// Everything up to the RAM test is inline, because the stack is not tested yet.
[[noreturn]] void reset_handler() {
  using namespace bms::hal;
  cortex_m::start_core();
  std::uint32_t* stack = nullptr;
  asm volatile("mov %0, sp" : "=r"(stack));
  stack -= 16;  // RAM below this address is unused
  const bool good =
      cortex_m::ram_passes(image_data_begin, image_bss_end) && cortex_m::ram_passes(image_stack_limit, stack);
  cortex_m::paint_stack(stack);
  for (std::uint32_t *from = image_data_load, *to = image_data_begin; to < image_data_end;) *to++ = *from++;
  for (std::uint32_t* to = image_bss_begin; to < image_bss_end;) *to++ = 0;
  ram_good = good;
  cortex_m::guard_stack();
  cortex_m::read_stored_fault();
  for (auto construct = image_constructors_begin; construct < image_constructors_end; ++construct) (*construct)();
  finish(main());
}

/// frame: r0-r3, r12, lr, pc, psr as the core pushed them (ARMv6-M and ARMv7-M, B1.5.6).
[[noreturn, gnu::used]] void record_fault(const std::uint32_t* frame) {
  using namespace bms::hal;
  cortex_m::unguard_stack();
  FaultRecord record;
  record.exception = cortex_m::scb_icsr() & 511U;
  cortex_m::read_fault_status(record);
  const auto at = reinterpret_cast<std::uintptr_t>(frame),
             ram = reinterpret_cast<std::uintptr_t>(image_stack_limit + cortex_m::guard_bytes / 4),
             top = reinterpret_cast<std::uintptr_t>(image_stack_top);
  if (at >= ram && at <= top - 8 * sizeof *frame) {  // otherwise the stack pointer itself was wrong
    record.lr = frame[5];
    record.pc = frame[6];
    record.psr = frame[7];
  }
  cortex_m::store_fault(record);
  cortex_m::system_reset();
}

/// Passes on the pushed frame and starts a new stack, because the old one may have failed. Uses ARMv6-M instructions
/// only.
[[gnu::naked]] void fault_handler() {
  asm volatile(
      ".syntax unified\n"
      "mov r0, lr\n"
      "lsls r0, r0, #29\n"  // bit 2 of lr selects the stack
      "mrs r0, msp\n"
      "bpl 1f\n"
      "mrs r0, psp\n"
      "1: ldr r1, =image_stack_top\n"
      "msr msp, r1\n"
      "bl record_fault\n"  // longer range than b; does not return
      ".ltorg\n");
}

}  // extern "C"
