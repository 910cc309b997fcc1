// Register model of the STM32F405's TIM5 with input capture on channel 4, whose input can be one of the slow
// oscillators. Written only from RM0090, 18.3.5 and 18.4; it shares no code with hal/. Other channels and modes are
// not modelled; `violations` lists their use, and an access without the clock of the timer.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace bms::firmware {

class TimerModel {
 public:
  static constexpr std::uint32_t base = 0x40000C00;
  static constexpr unsigned interrupt_number = 50;  ///< RM0090, table 61

  std::uint32_t read(std::uint32_t offset);
  void write(std::uint32_t offset, std::uint32_t value);
  /// Time passes. clock_hz: of the timer; lsi_hz, lse_hz: of the slow oscillators, 0 while one does not run.
  void pass(double us, double clock_hz, double lsi_hz, double lse_hz);
  bool interrupt() const;
  /// Time until the next capture at these frequencies, or infinity.
  double capture_after_us(double lsi_hz, double lse_hz) const;
  void reset() { *this = TimerModel(); }

  unsigned captures = 0;
  std::vector<std::string> violations;

 private:
  void edge(double count);
  double input_hz(double lsi_hz, double lse_hz) const;

  std::map<std::uint32_t, std::uint32_t> registers_;
  double count_ = 0, phase_ = 0;
  std::uint32_t status_ = 0, captured_ = 0, edges_ = 0;
};

}  // namespace bms::firmware
