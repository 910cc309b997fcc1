// Microseconds from the SysTick timer: an interrupt every millisecond, and the timer's value in between.
#include "hal/clock.hpp"

#include "hal/stm32f4/clock_stop.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/supply.hpp"

namespace bms::hal {

namespace {

volatile std::uint32_t milliseconds_low = 0, milliseconds_high = 0;
std::uint32_t ticks_per_us = 16;
std::uint64_t resumed_us = 0;  ///< time at which SysTick began to count, after a stop

}  // namespace

void clock_start() {
  const auto clocks = stm32f4::start_clocks();
  ticks_per_us = clocks.core_hz / 1'000'000;
  stm32f4::syst_rvr() = clocks.core_hz / 1'000 - 1;
  stm32f4::syst_cvr() = 0;
  stm32f4::syst_csr() = 7;  // core clock, interrupt, on
}

std::uint64_t now_us() {
  // read again if an interrupt occurred in between
  while (true) {
    const std::uint32_t high = milliseconds_high, low = milliseconds_low;
    const std::uint32_t ticks = stm32f4::syst_rvr() - stm32f4::syst_cvr();
    if (low == milliseconds_low && high == milliseconds_high)
      return resumed_us + (static_cast<std::uint64_t>(high) << 32 | low) * 1'000 + ticks / ticks_per_us;
  }
}

std::uint64_t stm32f4::pause_clock() {
  resumed_us = now_us();
  syst_csr() = 0;
  scb_icsr() = 1U << 25;  // no tick is pending
  milliseconds_low = 0;
  milliseconds_high = 0;
  return resumed_us;
}

void stm32f4::resume_clock(std::uint64_t stopped_us) {
  resumed_us += stopped_us;
  syst_cvr() = 0;
  syst_csr() = 7;
}

std::uint32_t core_clock_hz() { return stm32f4::clocks().core_hz; }

void wait_for_interrupt() {
  asm volatile("wfi");
  supply_attend();
}

}  // namespace bms::hal

extern "C" void clock_interrupt() {
  using namespace bms::hal;
  const std::uint32_t low = milliseconds_low + 1;
  milliseconds_low = low;
  if (low == 0) milliseconds_high = milliseconds_high + 1;
}
