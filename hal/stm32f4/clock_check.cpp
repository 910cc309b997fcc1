#include "hal/stm32f4/clock_check.hpp"

#include "hal/clock.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/stm32f4/supply.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t periods = 8, most_wrong = 8;
constexpr std::uint32_t timer_hz = 2 * stm32f4::crystal_apb1_hz;  // RM0090, 7.2
constexpr std::uint32_t from_lsi = 1U << 6, from_lse = 2U << 6, lse_ready = 1U << 1;
constexpr std::uint64_t silence_us = 50'000;

/// Counts of the timer in eight periods.
struct Range {
  std::uint32_t shortest, longest;
};
constexpr Range counts_of(std::uint32_t lowest_hz, std::uint32_t highest_hz) {
  return {periods * timer_hz / highest_hz, periods * timer_hz / lowest_hz + 1};
}
constexpr Range of_lsi = counts_of(17'000, 47'000), of_lse = counts_of(32'440, 33'096);

volatile std::uint32_t captures = 0;  ///< written by the interrupt only
volatile bool wrong = false, by_crystal = false;
std::uint32_t before = 0, wrong_in_a_row = 0;  ///< of the interrupt
std::uint32_t seen = 0;
std::uint64_t seen_us = 0;
bool crystal_silent = false;

void select(bool crystal) {
  by_crystal = crystal;
  stm32f4::tim5_or() = crystal ? from_lse : from_lsi;
  seen_us = now_us();
}

}  // namespace

namespace stm32f4 {

void clock_check_start() {
  if (clocks().core_hz != crystal_core_hz) return;
  rcc_csr() = rcc_csr() | 1U;  // LSI
  rcc_apb1enr() = rcc_apb1enr() | 1U << 3;
  tim5_ccmr2() = 1U << 8 | 3U << 10;  // channel 4 captures its own input, every eighth edge
  select(false);
  tim5_ccer() = 1U << 12;
  tim5_dier() = 1U << 4;
  tim5_cr1() = 1;
  nvic_iser1() = 1U << (tim5_interrupt - 32);
}

bool clock_wrong() {
  if (captures != seen) {
    seen = captures;
    seen_us = now_us();
  } else if (now_us() - seen_us >= silence_us) {
    if (by_crystal)
      crystal_silent = true;
    else
      wrong = true;
  }
  const bool crystal = !crystal_silent && (rcc_bdcr() & lse_ready) != 0;
  if (crystal != by_crystal) select(crystal);
  return wrong;
}

}  // namespace stm32f4

}  // namespace bms::hal

/// A capture that main() has missed, or the first one of another oscillator, is one wrong measurement.
extern "C" void tim5_interrupt() {
  using namespace bms::hal;
  const std::uint32_t now = stm32f4::tim5_ccr4();  // clears the request
  const std::uint32_t counts = now - before;
  const Range& range = by_crystal ? of_lse : of_lsi;
  before = now;
  captures = captures + 1;
  if (counts >= range.shortest && counts <= range.longest) {
    wrong_in_a_row = 0;
    return;
  }
  if (++wrong_in_a_row < most_wrong) return;
  wrong_in_a_row = 0;
  wrong = true;
  stm32f4::open_contactors();
}
