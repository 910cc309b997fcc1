// Microseconds from timer 0, because this core has no SysTick. An interrupt every millisecond detects each wrap of the
// 32-bit count (71 minutes).
#include "hal/clock.hpp"

#include "hal/nrf51/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t wake_every_us = 1'000;
/// Polls until the crystal is given up. It needs 1 ms; without it the internal oscillator continues to run.
constexpr unsigned max_polls = 100'000;

volatile std::uint32_t wraps = 0, seen_us = 0;

/// Call with interrupts disabled, or from the timer interrupt.
[[gnu::always_inline]] inline std::uint64_t read_timer() {
  nrf51::timer_capture1() = 1;
  const std::uint32_t us = nrf51::timer_cc1();
  if (us < seen_us) wraps = wraps + 1;
  seen_us = us;
  return static_cast<std::uint64_t>(wraps) << 32 | us;
}

}  // namespace

void clock_start() {
  using namespace nrf51;
  clock_hfclkstart() = 1;
  for (unsigned k = 0; k < max_polls && clock_hfclkstarted() == 0; ++k) {
  }
  timer_bitmode() = 3;    // 32 bits
  timer_prescaler() = 4;  // 16 MHz / 2^4
  timer_cc0() = wake_every_us;
  timer_intenset() = 1U << 16;  // compare 0
  timer_clear() = 1;
  cortex_m::nvic_iser0() = 1U << timer_interrupt;
  timer_start() = 1;
}

std::uint64_t now_us() {
  std::uint32_t mask = 0;
  asm volatile("mrs %0, primask\n cpsid i" : "=r"(mask)::"memory");
  const std::uint64_t us = read_timer();
  asm volatile("msr primask, %0" ::"r"(mask) : "memory");
  return us;
}

std::uint32_t core_clock_hz() { return 16'000'000; }

void wait_for_interrupt() { asm volatile("wfi"); }

}  // namespace bms::hal

extern "C" void clock_interrupt() {
  using namespace bms::hal;
  nrf51::timer_compare0() = 0;
  nrf51::timer_cc0() = static_cast<std::uint32_t>(read_timer()) + wake_every_us;
}
