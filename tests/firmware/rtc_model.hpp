// Register model of the STM32F405's real-time clock and backup domain. Written only from RM0090, 5.1.2, 7.3.20 and 26;
// it shares no code with hal/. The calendar is Gregorian. The model outlives a board: power_away() is the time between
// two.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace bms::firmware {

class RtcModel {
 public:
  static constexpr std::uint32_t base = 0x40002800;

  std::uint32_t read(std::uint32_t offset, double now_us);
  void write(std::uint32_t offset, std::uint32_t value, double now_us);
  std::uint32_t read_bdcr(double now_us) {
    advance(now_us);
    return bdcr;
  }
  /// allowed: DBP of PWR_CR.
  void write_bdcr(std::uint32_t value, bool allowed, double now_us);

  /// The power is off for some seconds. battery: connected to VBAT. The time of the next board begins at 0.
  void power_away(double seconds, bool battery);
  /// A reset of the core: the shadow registers are loaded again.
  void core_reset() { synchronised_ = false; }
  /// A stop of the core has ended: the shadow registers are out of date until software clears RSF (26.3.6).
  void stop_ended() { stale_ = true; }

  /// Output of the crystal oscillator. LSE_READY stays set if the crystal stops later.
  double lse_hz() const { return crystal && (bdcr & 2) != 0 ? crystal_hz : 0; }

  /// The wake-up timer has expired with its interrupt enabled, and its flag stands.
  bool wakes() const { return wakeup_flag_ && (cr_ & 1U << 14) != 0; }
  /// Time until it expires, or infinity.
  double wakes_after_us() const;
  void pass_until(double now_us) { advance(now_us); }

  bool crystal = true;
  double crystal_after_us = 2e6, crystal_hz = 32'768;
  std::uint32_t bdcr = 0;
  struct Date {
    int year = 0, month = 1, day = 1, hour = 0, minute = 0, second = 0;  ///< year of the century
  };
  Date date;
  std::vector<std::string> violations;

 private:
  void advance(double now_us);
  void second();
  double hz() const;
  double source_hz() const;
  void reset_domain();

  double at_us_ = 0, fraction_s_ = 0, crystal_on_us_ = -1;
  std::uint32_t prer_ = 0x007F00FF, dr_shadow_ = 0;
  std::array<std::uint32_t, 20> backup_{};
  int keys_ = 0, prescaler_writes_ = 0;
  std::uint32_t cr_ = 0, wutr_ = 0xFFFF;
  double wakeup_count_ = 0;  ///< left of the wake-up timer
  bool wakeup_flag_ = false, stale_ = false;
  bool initialising_ = false, synchronised_ = false, dr_locked_ = false;
};

}  // namespace bms::firmware
