// Provokes a fault and, after the reset that follows, checks the fault record of hal/.
//
//   command line "fw KIND"   KIND: address (a load from unmapped memory), undefined (an invalid instruction),
//                            stack (the stack pointer outside RAM), overflow (endless recursion: the stack grows into
//                            its guard)
//   exit code                0: the record agrees with the fault; otherwise the failed check, see Exit
//
// The second run must start by itself with unchanged RAM. The image decides by last_fault() which run it is.
#include <array>
#include <string_view>

#include "hal/cortex_m/stack.hpp"
#include "hal/emulated/semihosting.hpp"
#include "hal/power.hpp"

extern "C" {
std::uint32_t read_from(const std::uint32_t* address);
extern const std::uint8_t faulting_load[], faulting_instruction[];
}

// in assembler, so that the faulting instruction has a name
asm(R"(
  .thumb
  .global read_from
  .thumb_func
read_from:
  .global faulting_load
faulting_load:
  ldr r0, [r0]
  bx lr
  .global execute_nothing
  .thumb_func
execute_nothing:
  .global faulting_instruction
faulting_instruction:
  udf #0
  bx lr
  .global lose_the_stack
  .thumb_func
lose_the_stack:
  movs r0, #0
  mov sp, r0
  push {r0}
  bx lr
)");
extern "C" void execute_nothing();
extern "C" void lose_the_stack();

namespace {

enum Exit : int {
  as_expected = 0,
  no_fault_came = 10,
  wrong_pc = 11,
  wrong_status = 12,
  wrong_address = 13,
  wrong_exception = 14,
  unknown_kind = 15,
  guard_was_overwritten = 16
};

const auto* const nowhere = reinterpret_cast<const std::uint32_t*>(0x30000000);

std::uint32_t address(const void* p) { return reinterpret_cast<std::uint32_t>(p); }

/// In RAM that a reset does not change.
[[gnu::section(".noinit")]] volatile std::uint32_t below_the_stack;

#pragma GCC diagnostic ignored "-Winfinite-recursion"
/// Takes a frame of 200 bytes in each call.
[[gnu::noinline]] std::uint32_t deeper(std::uint32_t n) {
  volatile std::uint32_t frame[50];
  frame[n % 50] = n;
  return deeper(n + 1) + frame[n % 50];
}

Exit compare_record(std::string_view kind, const bms::hal::FaultRecord& fault) {
  constexpr std::uint32_t precise_bus_error = 1U << 9, address_valid = 1U << 15, undefined_instruction = 1U << 16,
                          bus_fault = 5, usage_fault = 6;
  if (kind == "address") {
    if (fault.exception != bus_fault) return wrong_exception;
    if (fault.pc != address(faulting_load)) return wrong_pc;
    if (fault.cfsr != (precise_bus_error | address_valid)) return wrong_status;
    return fault.address == address(nowhere) ? as_expected : wrong_address;
  }
  if (kind == "undefined") {
    if (fault.exception != usage_fault) return wrong_exception;
    if (fault.pc != address(faulting_instruction)) return wrong_pc;
    return fault.cfsr == undefined_instruction ? as_expected : wrong_status;
  }
  if (kind == "overflow") {
    constexpr std::uint32_t memory_fault = 4, data_access = 1U << 1, while_stacking = 1U << 4,
                            memory_address_valid = 1U << 7;
    if (fault.exception != memory_fault) return wrong_exception;
    if ((fault.cfsr & (data_access | while_stacking)) == 0) return wrong_status;
    const std::uint32_t guard = address(image_stack_limit);
    if ((fault.cfsr & memory_address_valid) != 0 &&
        (fault.address < guard || fault.address >= guard + bms::hal::cortex_m::guard_bytes))
      return wrong_address;
    return below_the_stack == 0x1234'5678 ? as_expected : guard_was_overwritten;
  }
  return fault.exception != 0 && fault.pc == 0 ? as_expected : wrong_pc;  // no frame could be stacked
}

}  // namespace

int main() {
  using namespace bms::hal;
  static std::array<char, 128> text;
  std::array<const char*, 2> words{};
  if (semihosting::arguments(text, words) != words.size()) return unknown_kind;
  const std::string_view kind = words[1];
  if (const auto fault = last_fault()) return compare_record(kind, *fault);
  below_the_stack = 0x1234'5678;
  if (kind == "overflow") return static_cast<int>(deeper(0)) | no_fault_came;
  if (kind == "address") return static_cast<int>(read_from(nowhere)) | no_fault_came;
  if (kind == "undefined")
    execute_nothing();
  else if (kind == "stack")
    lose_the_stack();
  else
    return unknown_kind;
  return no_fault_came;
}
