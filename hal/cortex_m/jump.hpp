// The jump from one image into another (ARMv7-M, B1.5.5): as the core does at a reset.
#pragma once

#include <cstdint>

#include "hal/cortex_m/registers.hpp"
#include "hal/cortex_m/stack.hpp"

namespace bms::hal::cortex_m {

/// Switches off SysTick, all interrupts and the guard of the stack; nothing stays pending.
inline void silence_core() {
  asm volatile("cpsid i" ::: "memory");
  at<0xE000E010>() = 0;                    // SYST_CSR
  at<0xE000ED04>() = 1U << 25 | 1U << 27;  // ICSR: no pending SysTick, no pending PendSV
  for (std::uint32_t k = 0; k < 3; ++k) {  // 82 interrupts
    reinterpret_cast<volatile std::uint32_t*>(0xE000E180)[k] = 0xFFFF'FFFF;  // ICER
    reinterpret_cast<volatile std::uint32_t*>(0xE000E280)[k] = 0xFFFF'FFFF;  // ICPR
  }
  unguard_stack();
}

[[noreturn]] inline void jump(std::uint32_t vectors) {
  const auto* const words = reinterpret_cast<const volatile std::uint32_t*>(vectors);
  const std::uint32_t stack = words[0], entry = words[1];
  asm volatile(
      "msr msp, %0\n"
      "cpsie i\n"
      "bx %1\n"
      :
      : "r"(stack), "r"(entry)
      : "memory");
  __builtin_unreachable();
}

}  // namespace bms::hal::cortex_m
