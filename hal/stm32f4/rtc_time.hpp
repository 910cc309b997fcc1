// Conversion between the calendar registers TR and DR and seconds since 1970 (RM0090, 26.6.1 and 26.6.2: decimal digits
// of four bits each; years 2000 to 2099).
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

namespace bms::hal::stm32f4 {

struct RtcTime {
  std::uint32_t tr = 0;  ///< hours 21:16, minutes 14:8, seconds 6:0
  std::uint32_t dr = 0;  ///< year 23:16, day of the week 15:13 (1: Monday), month 12:8, day 5:0
};

inline constexpr std::uint32_t first_of_2000_s = 946'684'800, last_of_2099_s = 4'102'444'799;

constexpr std::uint32_t to_digits(std::uint32_t n) { return n / 10 << 4 | n % 10; }
constexpr std::uint32_t from_digits(std::uint32_t digits) { return 10 * (digits >> 4) + (digits & 15); }

/// unix_s: first_of_2000_s to last_of_2099_s.
constexpr RtcTime rtc_time(std::uint32_t unix_s) {
  using namespace std::chrono;
  const sys_days day{days{unix_s / 86'400}};
  const year_month_day date{day};
  const std::uint32_t second = unix_s % 86'400;
  const auto year = static_cast<std::uint32_t>(static_cast<int>(date.year()) - 2'000);
  return {to_digits(second / 3'600) << 16 | to_digits(second / 60 % 60) << 8 | to_digits(second % 60),
          to_digits(year) << 16 | weekday{day}.iso_encoding() << 13 |
              to_digits(static_cast<unsigned>(date.month())) << 8 | to_digits(static_cast<unsigned>(date.day()))};
}

/// Returns nothing if the digits are not a valid date and time.
constexpr std::optional<std::uint32_t> unix_s(const RtcTime& t) {
  using namespace std::chrono;
  const std::uint32_t hour = from_digits(t.tr >> 16 & 0x3F), minute = from_digits(t.tr >> 8 & 0x7F),
                      second = from_digits(t.tr & 0x7F);
  const year_month_day date{year(2'000 + static_cast<int>(from_digits(t.dr >> 16 & 0xFF))),
                            month(from_digits(t.dr >> 8 & 0x1F)), day(from_digits(t.dr & 0x3F))};
  if (!date.ok() || hour > 23 || minute > 59 || second > 59) return std::nullopt;
  return static_cast<std::uint32_t>(sys_days{date}.time_since_epoch().count()) * 86'400 + hour * 3'600 + minute * 60 +
         second;
}

}  // namespace bms::hal::stm32f4
