// PA6: output of an insulation monitor, measured by timer 3 (RM0090, 18.3.6, PWM input mode): a rising edge captures
// the period and resets the counter, the falling edge captures the time of the high level. No interrupt.
#include "hal/insulation_pwm.hpp"
#include "hal/insulation.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t captured_period = 1U << 1;
/// Timers of APB1 run at twice its clock if that is divided (RM0090, 7.2).
std::uint32_t timer_hz() {
  return stm32f4::clocks().core_hz == stm32f4::crystal_core_hz ? 2 * stm32f4::crystal_apb1_hz
                                                               : stm32f4::clocks().core_hz;
}
/// A pulse takes at most 105 ms, a sample period 100 ms.
constexpr std::uint8_t most_samples_without = 3;

bool started = false;
std::uint8_t without = most_samples_without;
std::int32_t last_ohm = measurement::no_reading;

void start() {
  using namespace stm32f4;
  rcc_ahb1enr() = rcc_ahb1enr() | 1U << 0;
  rcc_apb1enr() = rcc_apb1enr() | 1U << 1;                   // timer 3
  gpioa_pupdr() = (gpioa_pupdr() & ~(3U << 12)) | 2U << 12;  // pull-down: a broken wire has no pulses
  gpioa_afrl() = (gpioa_afrl() & ~(15U << 24)) | 2U << 24;   // AF2
  gpioa_moder() = (gpioa_moder() & ~(3U << 12)) | 2U << 12;
  tim3_psc() = timer_hz() / 100'000 - 1;  // 10 us
  tim3_arr() = 0xFFFF;
  tim3_ccmr1() = 15U << 12 | 2U << 8 | 15U << 4 | 1U << 0;  // both captures from TI1, with the longest filter
  tim3_ccer() = 1U << 5 | 1U << 4 | 1U << 0;                // the second one at the falling edge
  tim3_smcr() = 5U << 4 | 4U << 0;                          // TI1FP1 resets the counter
  tim3_egr() = 1U;
  tim3_sr() = 0;
  tim3_cr1() = 1U;
}

}  // namespace

Insulation insulation() {
  using namespace stm32f4;
  if (!started) start();
  if ((tim3_sr() & captured_period) != 0) {
    const std::uint32_t high = tim3_ccr2(), period = tim3_ccr1();  // reading it clears the flag
    last_ohm = insulation_pwm::ohm_of(period, high);
    without = 0;
  } else if (without < most_samples_without) {
    ++without;
  }
  started = true;
  return {true, without < most_samples_without ? last_ohm : measurement::no_reading};
}

}  // namespace bms::hal
