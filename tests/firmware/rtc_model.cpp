#include "tests/firmware/rtc_model.hpp"

#include <limits>

namespace bms::firmware {

namespace {

constexpr std::uint32_t lse_on = 1, lse_ready = 2, enabled = 1U << 15, domain_reset = 1U << 16;  // RCC_BDCR, 7.3.20

constexpr std::uint32_t wakeup_on = 1U << 10, wakeup_interrupt = 1U << 14;  // RTC_CR, 26.6.3
constexpr std::uint32_t first_backup = 0x50;                                // RTC_BKP0R to RTC_BKP19R, 26.6.20
bool is_backup(std::uint32_t at) { return at >= first_backup && at < first_backup + 4 * 20; }

std::uint32_t digits(int n) { return static_cast<std::uint32_t>(n / 10 * 16 + n % 10); }
int number(std::uint32_t d) { return static_cast<int>(d / 16 * 10 + d % 16); }

}  // namespace

void RtcModel::write_bdcr(std::uint32_t value, bool allowed, double now_us) {
  if (!allowed) {
    violations.push_back("RCC_BDCR is written while the backup domain is protected");
    return;
  }
  if ((value & domain_reset) != 0) return reset_domain();
  const std::uint32_t selected = bdcr >> 8 & 3, wanted = value >> 8 & 3;
  if (selected != 0 && wanted != selected)
    violations.push_back("the clock source is changed without a reset of the backup domain");
  if ((value & lse_on) != 0 && (bdcr & lse_on) == 0) crystal_on_us_ = now_us;
  bdcr = (bdcr & lse_ready) | (value & ~lse_ready);
  advance(now_us);
}

void RtcModel::reset_domain() {
  bdcr = 0;
  date = {};
  prer_ = 0x007F00FF;
  cr_ = 0;
  wakeup_flag_ = false;
  backup_ = {};
  crystal_on_us_ = -1;
  initialising_ = synchronised_ = dr_locked_ = false;
}

double RtcModel::source_hz() const {
  if ((bdcr & enabled) == 0) return 0;
  const std::uint32_t selected = bdcr >> 8 & 3;
  if (selected == 1 && (bdcr & lse_ready) != 0) return crystal ? crystal_hz : 0;
  return selected == 2 ? 32'000 : 0;
}

/// 26.6.6: WUCKSEL 0 divides by 16; the model has no other choice.
double RtcModel::wakes_after_us() const {
  if ((cr_ & wakeup_on) == 0 || source_hz() <= 0) return std::numeric_limits<double>::infinity();
  return 1e6 * wakeup_count_ / (source_hz() / 16);
}

double RtcModel::hz() const {
  if (initialising_) return 0;
  return source_hz() / ((prer_ >> 16 & 0x7F) + 1) / ((prer_ & 0x7FFF) + 1);
}

void RtcModel::advance(double now_us) {
  if (crystal && (bdcr & lse_on) != 0 && crystal_on_us_ >= 0 && now_us - crystal_on_us_ >= crystal_after_us)
    bdcr |= lse_ready;
  if ((cr_ & wakeup_on) != 0) {
    wakeup_count_ -= 1e-6 * (now_us - at_us_) * source_hz() / 16;
    for (; wakeup_count_ <= 0; wakeup_count_ += wutr_ + 1.0) wakeup_flag_ = true;
  }
  fraction_s_ += 1e-6 * (now_us - at_us_) * hz();
  at_us_ = now_us;
  for (; fraction_s_ >= 1; fraction_s_ -= 1) second();
  if (!initialising_ && hz() > 0) synchronised_ = true;
}

void RtcModel::second() {
  const int days[] = {31, date.year % 4 == 0 ? 29 : 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  if (++date.second < 60) return;
  date.second = 0;
  if (++date.minute < 60) return;
  date.minute = 0;
  if (++date.hour < 24) return;
  date.hour = 0;
  if (++date.day <= days[date.month - 1]) return;
  date.day = 1;
  if (++date.month <= 12) return;
  date.month = 1;
  date.year = (date.year + 1) % 100;
}

void RtcModel::power_away(double seconds, bool battery) {
  if (!battery) {
    reset_domain();
  } else if ((bdcr >> 8 & 3) == 1) {  // VBAT does not supply the internal oscillator
    fraction_s_ += seconds * hz();
    for (; fraction_s_ >= 1; fraction_s_ -= 1) second();
  }
  at_us_ = 0;
  if ((bdcr & lse_on) != 0) crystal_on_us_ = -crystal_after_us;  // it kept running
  synchronised_ = false;
  keys_ = 0;
}

std::uint32_t RtcModel::read(std::uint32_t at, double now_us) {
  advance(now_us);
  if (stale_ && (at == 0x00 || at == 0x28)) violations.push_back("the time of before the stop is read");
  const std::uint32_t dr = digits(date.year) << 16 | digits(date.month) << 8 | digits(date.day);
  switch (at) {
    case 0x00:
      if (!synchronised_) violations.push_back("TR is read before it is synchronised");
      dr_locked_ = true;
      dr_shadow_ = dr;
      return digits(date.hour) << 16 | digits(date.minute) << 8 | digits(date.second);
    case 0x04:
      if (!dr_locked_) return dr;
      dr_locked_ = false;
      return dr_shadow_;
    case 0x0C:
      return (wakeup_flag_ ? 1U << 10 : 0U) | ((cr_ & wakeup_on) == 0 ? 1U << 2 : 0U) |
             (date.year != 0 ? 1U << 4 : 0U) | (synchronised_ ? 1U << 5 : 0U) | (initialising_ ? 3U << 6 : 0U) | 3U;
    case 0x08:
      return cr_;
    case 0x10:
      return prer_;
    case 0x14:
      return wutr_;
    case 0x28: {
      if (!synchronised_) violations.push_back("SSR is read before it is synchronised");
      const std::uint32_t counts = (prer_ & 0x7FFF) + 1;
      return counts - 1 - static_cast<std::uint32_t>(fraction_s_ * counts);
    }
    default:
      return is_backup(at) ? backup_[(at - first_backup) / 4] : 0;
  }
}

void RtcModel::write(std::uint32_t at, std::uint32_t value, double now_us) {
  advance(now_us);
  if (at == 0x24) {
    const bool second_key = value == 0x53 && keys_ == 1;
    keys_ = second_key ? 2 : 0;
    if (value == 0xCA) keys_ = 1;
    return;
  }
  if (is_backup(at)) {
    backup_[(at - first_backup) / 4] = value;
    return;
  }
  if (keys_ != 2) {
    violations.push_back("a clock register is written while locked");
    return;
  }
  if (at == 0x0C) {
    if ((bdcr & enabled) == 0) violations.push_back("the clock is set while it is off");
    if ((value & 1U << 10) == 0) wakeup_flag_ = false;
    if ((value & 1U << 5) == 0) synchronised_ = stale_ = false;
    const bool was = initialising_;
    initialising_ = (value & 1U << 7) != 0;
    if (initialising_) synchronised_ = false;
    if (!was && initialising_) prescaler_writes_ = 0;
    if (was && !initialising_) fraction_s_ = 0;
    if (was && !initialising_ && prescaler_writes_ != 2) violations.push_back("PRER takes two writes");
    return;
  }
  if (at == 0x08) {
    if ((value & wakeup_on) != 0 && (cr_ & wakeup_on) == 0) wakeup_count_ = wutr_ + 1.0;
    if ((value & ~(wakeup_on | wakeup_interrupt)) != 0) violations.push_back("RTC_CR has bits that are not modelled");
    cr_ = value;
    return;
  }
  if (at == 0x14) {
    if ((cr_ & wakeup_on) != 0) violations.push_back("WUTR is written while its timer runs");
    wutr_ = value & 0xFFFF;
    return;
  }
  if (!initialising_) {
    violations.push_back("the calendar is written outside initialisation");
    return;
  }
  if (at == 0x10) {
    prer_ = value;
    ++prescaler_writes_;
  } else if (at == 0x00) {
    date.hour = number(value >> 16 & 0x3F);
    date.minute = number(value >> 8 & 0x7F);
    date.second = number(value & 0x7F);
  } else if (at == 0x04) {
    date.year = number(value >> 16 & 0xFF);
    date.month = number(value >> 8 & 0x1F);
    date.day = number(value & 0x3F);
  }
}

}  // namespace bms::firmware
