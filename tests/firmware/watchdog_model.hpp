// Register model of the STM32F405's independent watchdog (IWDG). Written only from RM0090, 21; it shares no code with
// hal/. Its clock is the slow oscillator of the clock tree, whose frequency a test chooses.
//
// `violations` lists accesses that the chip ignores: prescaler or reload value while locked, or while an earlier value
// is still on its way.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/firmware/rcc_model.hpp"

namespace bms::firmware {

class WatchdogModel {
 public:
  static constexpr std::uint32_t base = 0x40003000;

  explicit WatchdogModel(RccModel& clocks) : clocks_(clocks) {}

  std::uint32_t read(std::uint32_t offset, double now_us);
  void write(std::uint32_t offset, std::uint32_t value, double now_us);
  bool expired(double now_us);
  /// by_hardware: the option byte starts the watchdog with the reset (21.3.1).
  void reset(double now_us, bool by_hardware);

  unsigned feeds = 0;
  double longest_unfed_ms = 0;
  /// Longest time to the reset after a feed, with the prescaler that counts it [ms].
  double longest_timeout_ms = 0;
  std::vector<std::string> violations;

 private:
  /// A register of the watchdog: a write takes effect five cycles of the oscillator later (21.4.4).
  struct Value {
    std::uint32_t now, next;
    double cycles_left;
  };
  void start(double now_us);
  void feed(double now_us);
  void note_timeout();
  void advance(double now_us);
  void write_value(Value& value, std::uint32_t next);

  RccModel& clocks_;
  Value prescaler_{0, 0, 0}, reload_{0xFFF, 0xFFF, 0};
  bool running_ = false, unlocked_ = false;
  double left_ = 0;  ///< counts to the reset
  double at_us_ = 0, fed_us_ = -1;
};

}  // namespace bms::firmware
