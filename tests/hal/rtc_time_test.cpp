#include "hal/stm32f4/rtc_time.hpp"

#include <ctime>

#include <gtest/gtest.h>

namespace bms::hal::stm32f4 {
namespace {

constexpr std::uint32_t day_s = 86'400;

std::uint32_t digits(int n) { return static_cast<std::uint32_t>(n / 10 * 16 + n % 10); }

/// Reference: the calendar of the C library.
RtcTime expected(std::uint32_t s) {
  const std::time_t t = s;
  std::tm of{};
  gmtime_r(&t, &of);
  const int weekday = of.tm_wday == 0 ? 7 : of.tm_wday;
  return {digits(of.tm_hour) << 16 | digits(of.tm_min) << 8 | digits(of.tm_sec),
          digits(of.tm_year - 100) << 16 | static_cast<std::uint32_t>(weekday) << 13 | digits(of.tm_mon + 1) << 8 |
              digits(of.tm_mday)};
}

TEST(RtcTime, EqualsTheCLibraryForEveryDayOfTheCenturyInBothDirections) {
  std::uint32_t second = 0, days = 0;
  for (std::uint64_t day = first_of_2000_s; day <= last_of_2099_s; day += day_s, ++days) {
    second = (second + 49'999) % day_s;  // coprime to a day, so all hours, minutes and seconds occur
    for (const std::uint32_t at : {0U, second, day_s - 1}) {
      const auto s = static_cast<std::uint32_t>(day) + at;
      const RtcTime t = rtc_time(s), e = expected(s);
      ASSERT_EQ(t.tr, e.tr) << s;
      ASSERT_EQ(t.dr, e.dr) << s;
      ASSERT_EQ(unix_s(t), s);
    }
  }
  EXPECT_EQ(days, 36'525U);
}

TEST(RtcTime, DigitsWithoutAValidDateGiveNoTime) {
  const RtcTime good = rtc_time(1'800'000'000);
  EXPECT_TRUE(unix_s(good));
  EXPECT_FALSE(unix_s({good.tr, 0})) << "month 0, day 0: as after a loss of the backup supply";
  EXPECT_FALSE(unix_s({good.tr, 0x23'02'29})) << "no leap year";
  EXPECT_TRUE(unix_s({good.tr, 0x24'02'29}));
  EXPECT_FALSE(unix_s({good.tr, 0x24'13'01}));
  EXPECT_FALSE(unix_s({0x24'00'00, good.dr}));
  EXPECT_FALSE(unix_s({0x00'60'00, good.dr}));
  EXPECT_FALSE(unix_s({0x00'00'60, good.dr}));
}

}  // namespace
}  // namespace bms::hal::stm32f4
