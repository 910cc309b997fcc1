// Stop mode between two samples (RM0090, 5.3.5): core, PLL and crystal stand still, RAM, registers and the levels of
// the pins stay. It ends by
//
//   the wake-up timer of the real-time clock (26.3.6), in time for the next sample; key and plug are read with it
//   a falling edge of CAN RX (PB8): its frame is lost
//   the supply detector, a lost contact and the coil supply, as always
//
// PB12 is high meanwhile: the transceiver only listens (RS of an SN65HVD230). With a bus of its own for the charger it
// is PB0 for both transceivers, and a falling edge of CAN2 RX (PB12) ends the stop, too. It is watched in the stop
// only, because its interrupt is that of the auxiliary contacts: of a charger that repeats its frame each second the
// second one may be lost as well.
//
// The CAN controller is off the bus from before the stop until the next frames are read, and joins eleven recessive
// bits later. An edge of CAN RX in all this time means that a node talks: the chip stays awake and receives its next
// frame.
//
// The real-time clock measures the time asleep, to 1/256 s. It needs the 32,768 Hz crystal: without it, or if it dies
// later, which its ready flag does not show, the chip waits for interrupts instead.
#include "hal/sleep.hpp"

#include <optional>
#include <utility>

#include "hal/can_suspend.hpp"
#include "hal/charger_bus.hpp"
#include "hal/clock.hpp"
#include "hal/power.hpp"
#include "hal/stm32f4/clock_stop.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/stm32f4/rtc_time.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

constexpr std::uint32_t lse_ready = 1U << 1, clock_selected = 3U << 8, from_lse = 1U << 8, rtc_enabled = 1U << 15;
constexpr std::uint32_t may_be_written = 1U << 2, synchronised = 1U << 5, setting = 1U << 7, timer_flag = 1U << 10,
                        timer_on = 1U << 10, timer_interrupt = 1U << 14;  // RTC_ISR, RTC_CR
constexpr std::uint32_t timer_line = 1U << 22, receive_line = 1U << 8;    // EXTI
constexpr std::uint32_t clock_check = 1U << (tim5_interrupt - 32);
constexpr std::uint32_t interrupts = 1U << rtc_wakeup_interrupt | 1U << exti9_5_interrupt;
constexpr std::uint32_t regulator_low = 1U << 0, standby = 1U << 1, flash_off = 1U << 9;  // PWR_CR
constexpr std::uint32_t deep = 1U << 2;                                                   // SCR
constexpr std::uint32_t converter_on = 1U << 0;  // ADC_CR2; it needs 3 us, start_clocks() takes 2 ms
constexpr std::uint32_t timer_hz = 32'768 / 16, ticks_per_s = 256, ticks_per_day = ticks_per_s * 86'400;
/// Of the crystal (2 ms, datasheet, HSE oscillator), of the PLL and of the regulator.
constexpr std::uint64_t start_us = 4'000, shortest_us = 8'000;
constexpr unsigned max_polls = 20'000;  // 1 ms; the longest wait is two cycles of 32,768 Hz

bool parked = false, clock_died = false;
bool off_the_bus = false;  ///< has been since watch_bus()

bool clock_runs() {
  if ((rcc_bdcr() & lse_ready) == 0) return false;
  if ((rcc_bdcr() & clock_selected) == 0) rcc_bdcr() = rcc_bdcr() | from_lse;
  if ((rcc_bdcr() & rtc_enabled) == 0) rcc_bdcr() = rcc_bdcr() | rtc_enabled;
  return (rcc_bdcr() & clock_selected) == from_lse;
}

bool wait_for(std::uint32_t bit) {
  for (unsigned k = 0; k < max_polls; ++k) {
    if ((rtc_isr() & bit) != 0) return true;
  }
  return false;
}

void unlock() {
  rtc_wpr() = 0xCA;
  rtc_wpr() = 0x53;
}
void lock() { rtc_wpr() = 0xFF; }
/// Flags are cleared by 0.
void clear(std::uint32_t flag) { rtc_isr() = ~(flag | setting); }

/// Ticks of the day. The shadow registers are out of date after a stop until they are synchronised, which a clock that
/// stands still never does.
std::optional<std::uint32_t> day_ticks() {
  unlock();
  clear(synchronised);
  lock();
  if (!wait_for(synchronised)) return std::nullopt;
  const std::uint32_t below = ticks_per_s - 1 - rtc_ssr(), tr = rtc_tr();
  const std::uint32_t read = rtc_dr();  // frees the shadow registers
  static_cast<void>(read);
  const std::uint32_t s =
      from_digits(tr >> 16 & 0x3F) * 3'600 + from_digits(tr >> 8 & 0x7F) * 60 + from_digits(tr & 0x7F);
  return s * ticks_per_s + below;
}

/// Returns false if the timer cannot be set.
bool start_timer(std::uint32_t counts) {
  unlock();
  rtc_cr() = rtc_cr() & ~timer_on;
  const bool may = wait_for(may_be_written);
  if (may) {
    rtc_wutr() = counts - 1;
    clear(timer_flag);
    rtc_cr() = timer_on | timer_interrupt;  // 32,768 Hz / 16
  }
  lock();
  return may;
}

void end_timer() {
  unlock();
  rtc_cr() = 0;
  clear(timer_flag);
  lock();
}

/// Interrupts are masked: they wake the core, and their handlers run when the clocks do. Returns the time at which the
/// clock stopped.
std::uint64_t stop() {
  const std::uint64_t stopped_us = pause_clock();
  nvic_icer1() = clock_check;  // on the internal oscillator every measurement is wrong
  stop_clocks();
  adc1_cr2() = 0;  // the converter goes on needing its current otherwise (RM0090, 5.3.5)
  pwr_cr() = (pwr_cr() & ~standby) | regulator_low | flash_off;
  scb_scr() = scb_scr() | deep;
  asm volatile("dsb\n wfi\n isb" ::: "memory");
  scb_scr() = scb_scr() & ~deep;
  adc1_cr2() = converter_on;
  if (start_clocks().core_hz != crystal_core_hz) finish(1);  // the next start finds out
  nvic_iser1() = clock_check;
  return stopped_us;
}

constexpr std::uint32_t listen_pin = has_second_bus ? 0 : 12;  // of port B
constexpr std::uint32_t only_listens = 1U << listen_pin;
constexpr std::uint32_t charger_line = 1U << 12;  // EXTI12: PB12
constexpr std::uint32_t contacts_interrupt = 1U << (exti15_10_interrupt - 32);
bool charger_stirs = false;     ///< in the last stop
bool contacts_watched = false;  ///< their interrupt was on before

/// Call while the controller is on the bus. From now on the line keeps an edge; its interrupt is off.
void watch_bus() {
  rcc_apb2enr() = rcc_apb2enr() | 1U << 14;           // SYSCFG
  syscfg_exticr3() = (syscfg_exticr3() & ~15U) | 1U;  // line 8: port B
  exti_ftsr() = exti_ftsr() | receive_line;
  exti_imr() = exti_imr() | receive_line;
  exti_pr() = receive_line;
}

/// The contacts of the same interrupt may be absent: then it has no handler, and only wakes.
void listen_to_charger() {
  syscfg_exticr4() = (syscfg_exticr4() & ~15U) | 1U;  // line 12: port B
  exti_ftsr() = exti_ftsr() | charger_line;
  exti_pr() = charger_line;
  exti_imr() = exti_imr() | charger_line;
  contacts_watched = (nvic_iser1() & contacts_interrupt) != 0;
  nvic_iser1() = contacts_interrupt;
}

/// A contact that has moved keeps its flag, and so its interrupt is pending again.
void end_listening_to_charger() {
  charger_stirs = (exti_pr() & charger_line) != 0;
  exti_imr() = exti_imr() & ~charger_line;
  exti_pr() = charger_line;
  if (!contacts_watched) nvic_icer1() = contacts_interrupt;
  nvic_icpr1() = contacts_interrupt;
}

/// An edge since watch_bus() wakes the core at once. Interrupts are masked: those of the lines have no handler.
void listen() {
  gpiob_bsrr() = only_listens;
  gpiob_moder() = (gpiob_moder() & ~(3U << 2 * listen_pin)) | 1U << 2 * listen_pin;
  exti_rtsr() = exti_rtsr() | timer_line;
  exti_pr() = timer_line;
  exti_imr() = exti_imr() | timer_line;
  nvic_icpr0() = interrupts;  // what is left; a line with its flag set is pending again
  nvic_iser0() = interrupts;
  if constexpr (has_charger_bus) listen_to_charger();
}

void end_listening() {
  if constexpr (has_charger_bus) end_listening_to_charger();
  gpiob_bsrr() = only_listens << 16;
  exti_imr() = exti_imr() & ~timer_line;
  nvic_icer0() = interrupts;
  exti_pr() = timer_line;
}

}  // namespace

void set_parked(bool now) { parked = now; }
bool bus_stirs() { return off_the_bus && ((exti_pr() & receive_line) != 0 || (has_charger_bus && charger_stirs)); }

void rest_until(std::uint64_t due_us) {
  const std::uint64_t now = now_us();
  if (!parked || clock_died || due_us < now + start_us + shortest_us || !clock_runs()) return wait_for_interrupt();
  if (std::exchange(off_the_bus, false) && (exti_pr() & receive_line) != 0) can_active();
  if (has_charger_bus && std::exchange(charger_stirs, false)) charger_can_active();
  watch_bus();
  if (has_charger_bus && !charger_can_quiet(silence_before_stop_us)) return wait_for_interrupt();
  if (!can_suspend(silence_before_stop_us)) return wait_for_interrupt();
  if (has_charger_bus && !charger_can_suspend(silence_before_stop_us)) return wait_for_interrupt();
  off_the_bus = true;
  const auto before = day_ticks();
  const std::uint64_t before_us = now_us();
  if (!before || !start_timer(static_cast<std::uint32_t>((due_us - now - start_us) * timer_hz / 1'000'000))) {
    clock_died = true;  // or the controller would leave the bus again and again
    return wait_for_interrupt();
  }
  asm volatile("cpsid i" ::: "memory");
  listen();
  const std::uint64_t awake_us = stop() - before_us;  // in both clocks
  const auto after = day_ticks();
  const std::uint32_t ticks = after ? (*after + ticks_per_day - *before) % ticks_per_day : 0;
  end_listening();
  end_timer();
  const std::uint64_t since_us = std::uint64_t{ticks} * 1'000'000 / ticks_per_s;
  resume_clock(since_us > awake_us ? since_us - awake_us : 0);
  asm volatile("cpsie i" ::: "memory");
}

}  // namespace bms::hal
