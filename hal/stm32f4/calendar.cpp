// Real-time clock in the backup domain (RM0090, 26 and 5.1.2), which VBAT supplies while the board is off. It runs on
// the 32,768 Hz crystal, which VBAT also supplies. Without a crystal it runs on the internal oscillator of 32 kHz (17
// to 47 kHz), which VBAT does not supply, so after a loss of power its time is invalid.
//
// A mark in backup register 0 records which oscillator the clock had when it was set. The mark, the time and the words
// of backup_word(), which are in the registers after it, are lost with the backup supply.
#include "hal/calendar.hpp"

#include "hal/clock.hpp"
#include "hal/power.hpp"
#include "hal/stm32f4/registers.hpp"
#include "hal/stm32f4/rtc_time.hpp"

namespace bms::hal {

namespace {

using namespace stm32f4;

constexpr std::uint32_t lse_on = 1U << 0, lse_ready = 1U << 1, clock_selected = 3U << 8, from_lse = 1U << 8,
                        from_lsi = 2U << 8, rtc_enabled = 1U << 15;  // RCC_BDCR
constexpr std::uint32_t lsi_on = 1U << 0, lsi_ready = 1U << 1;       // RCC_CSR
constexpr std::uint32_t synchronised = 1U << 5, may_be_set = 1U << 6, setting = 1U << 7, year_set = 1U << 4;  // RTC_ISR
constexpr std::uint32_t set_by_lse = 0x7105'E5E1, set_by_lsi = 0x7105'E512;  // in backup register 0
/// Typically 2 s (datasheet, LSE oscillator characteristics), longer in the cold.
constexpr std::uint64_t crystal_start_us = 5'000'000;
constexpr unsigned max_polls = 200'000;  // about 10 ms; the longest wait is three cycles of 32 kHz

bool wait_for(Register& reg, std::uint32_t bit) {
  for (unsigned k = 0; k < max_polls; ++k) {
    if ((reg & bit) != 0) return true;
  }
  return false;
}

bool lost_its_clock = false;  // ran on the internal oscillator, and the power was off

CalendarState state() {
  if (lost_its_clock || (rcc_bdcr() & rtc_enabled) == 0 || (rtc_isr() & year_set) == 0) return CalendarState::never_set;
  const std::uint32_t mark = rtc_bkp0r();
  if (mark == set_by_lse) return CalendarState::runs;
  return mark == set_by_lsi ? CalendarState::runs_roughly : CalendarState::never_set;
}

}  // namespace

void calendar_start() {
  rcc_apb1enr() = rcc_apb1enr() | 1U << 28;  // power interface
  pwr_cr() = pwr_cr() | 1U << 8;             // enable writes to the backup domain
  rcc_bdcr() = rcc_bdcr() | lse_on;
  if ((rcc_bdcr() & clock_selected) != from_lsi) return;
  const ResetCause cause = reset_cause();
  lost_its_clock = cause == ResetCause::power_on || cause == ResetCause::brown_out || cause == ResetCause::unknown;
  rcc_csr() = rcc_csr() | lsi_on;
}

CalendarState calendar_state() { return state(); }

std::optional<std::uint32_t> calendar_s() {
  if (state() == CalendarState::never_set) return std::nullopt;
  // After a reset the shadow registers are valid two cycles later.
  if (!wait_for(rtc_isr(), synchronised)) return std::nullopt;
  const std::uint32_t tr = rtc_tr();  // freezes DR until DR is read
  return unix_s({tr, rtc_dr()});
}

bool calendar_set(std::uint32_t unix_s) {
  if (unix_s < first_of_2000_s || unix_s > last_of_2099_s) return false;
  if ((rcc_bdcr() & clock_selected) == 0) {
    // The selection is final while the backup domain is supplied; changing it would need a reset of the domain.
    const bool crystal = (rcc_bdcr() & lse_ready) != 0;
    if (!crystal && now_us() < crystal_start_us) return false;
    if (!crystal) {
      rcc_csr() = rcc_csr() | lsi_on;
      if (!wait_for(rcc_csr(), lsi_ready)) return false;
    }
    rcc_bdcr() = rcc_bdcr() | (crystal ? from_lse : from_lsi);
  }
  rcc_bdcr() = rcc_bdcr() | rtc_enabled;
  const bool by_lse = (rcc_bdcr() & clock_selected) == from_lse;
  rtc_wpr() = 0xCA;  // unlock
  rtc_wpr() = 0x53;
  rtc_isr() = 0xFFFF'FFFF;  // initialisation mode; flags are cleared by 0, so they stay
  const bool may = wait_for(rtc_isr(), may_be_set);
  if (may) {
    const RtcTime time = rtc_time(unix_s);
    const std::uint32_t synchronous = by_lse ? 32'768 / 128 - 1 : 32'000 / 128 - 1;
    rtc_prer() = synchronous;  // the two fields need separate writes (26.3.5)
    rtc_prer() = synchronous | 127U << 16;
    rtc_tr() = time.tr;
    rtc_dr() = time.dr;
    rtc_bkp0r() = by_lse ? set_by_lse : set_by_lsi;
    lost_its_clock = false;
  }
  rtc_isr() = ~setting;
  rtc_wpr() = 0xFF;  // locked
  return may;
}

std::uint32_t backup_word(std::size_t k) { return (&rtc_bkp0r())[1 + k]; }
void set_backup_word(std::size_t k, std::uint32_t value) { (&rtc_bkp0r())[1 + k] = value; }

}  // namespace bms::hal
