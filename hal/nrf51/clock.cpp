// Microseconds from timer 0: this chip's core has no SysTick. An interrupt each millisecond, so that no turn of its 32
// bits (71 minutes) is missed.
#include "hal/clock.hpp"

#include "hal/nrf51/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t wake_every_us = 1'000;
constexpr unsigned patience =
    100'000;  // a crystal needs 1 ms; the internal oscillator runs meanwhile, and where it stays away

volatile std::uint32_t turns = 0, seen_us = 0;

/// With interrupts off, or from the only one that asks.
[[gnu::always_inline]] inline std::uint64_t read_timer() {
  nrf51::timer_capture1() = 1;
  const std::uint32_t us = nrf51::timer_cc1();
  if (us < seen_us) turns = turns + 1;
  seen_us = us;
  return static_cast<std::uint64_t>(turns) << 32 | us;
}

}  // namespace

void clock_start() {
  using namespace nrf51;
  clock_hfclkstart() = 1;
  for (unsigned k = 0; k < patience && clock_hfclkstarted() == 0; ++k) {
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
