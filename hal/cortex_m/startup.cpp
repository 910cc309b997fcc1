// From reset to main(): the core, .data and .bss, constructors; and the handler of faults, which records what the core
// saw and resets it (one that stops would leave contactors as they are until the watchdog bites).
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

// from the linker script
extern std::uint32_t image_data_load[], image_data_begin[], image_data_end[], image_bss_begin[], image_bss_end[];
extern void (*image_constructors_begin[])();
extern void (*image_constructors_end[])();

int main();

/// The RAM is tried by what is inline here: there is no stack to trust.
[[noreturn]] void reset_handler() {
  using namespace bms::hal;
  cortex_m::start_core();
  std::uint32_t* stack = nullptr;
  asm volatile("mov %0, sp" : "=r"(stack));
  stack -= 16;  // what is below is free
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

/// frame: r0-r3, r12, lr, pc, psr as the core stacked them (ARMv6-M and ARMv7-M, B1.5.6).
[[noreturn, gnu::used]] void record_fault(const std::uint32_t* frame) {
  using namespace bms::hal;
  cortex_m::unguard_stack();
  FaultRecord record;
  record.exception = cortex_m::scb_icsr() & 511U;
  cortex_m::read_fault_status(record);
  const auto at = reinterpret_cast<std::uintptr_t>(frame),
             ram = reinterpret_cast<std::uintptr_t>(image_stack_limit + cortex_m::guard_bytes / 4),
             top = reinterpret_cast<std::uintptr_t>(image_stack_top);
  if (at >= ram && at <= top - 8 * sizeof *frame) {  // else the stack itself was the fault
    record.lr = frame[5];
    record.pc = frame[6];
    record.psr = frame[7];
  }
  cortex_m::store_fault(record);
  cortex_m::system_reset();
}

/// Takes the stacked frame, then a fresh stack: the old one may be what failed. In instructions that ARMv6-M has.
[[gnu::naked]] void fault_handler() {
  asm volatile(
      ".syntax unified\n"
      "mov r0, lr\n"
      "lsls r0, r0, #29\n"  // bit 2 of lr: which stack
      "mrs r0, msp\n"
      "bpl 1f\n"
      "mrs r0, psp\n"
      "1: ldr r1, =image_stack_top\n"
      "msr msp, r1\n"
      "bl record_fault\n"  // reaches further than b, and does not come back
      ".ltorg\n");
}

}  // extern "C"
