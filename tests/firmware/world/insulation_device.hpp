// An insulation monitor between battery and frame with a pulse output, and timer 3 of the STM32F405 that measures the
// pulses at PA6. Written from the data sheet of the Bender IR155-3203 and -3204 (D00115, measuring and fault signals)
// and from RM0090, 18.3.6 and 18.4; nothing is shared with hal/ and firmware/.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/firmware/unicorn_board.hpp"
#include "tests/firmware/world/gpio_model.hpp"

namespace bms::world {

/// The state is the frequency, the resistance the share of the high level: 5 % infinite, 50 % 1.2 Mohm, 95 % none.
class InsulationDevice {
 public:
  enum class Fault { none, device, earth_broken, no_supply };
  Fault fault = Fault::none;
  static constexpr double response_ohm = 100e3;  ///< chosen: of the first estimate, good above twice it

  /// Time passes; ohm: between battery and frame.
  void pass(double seconds, double ohm);
  struct Pulse {
    double hz, share;  ///< 0 Hz: low
  };
  Pulse pulse() const;

 private:
  static constexpr double estimates_s = 2;      ///< from power-on to the first value
  static constexpr double averages_over_s = 4;  ///< chosen: half of 10 kohm and less is shown below it within 20 s

  double on_s_ = 0, share_ = 0.05, ohm_ = 1e9;
};

/// Timer 3 with both captures from channel 1: the rising edge captures the period and resets the counter, the falling
/// one captures the high time. `violations` lists other modes and accesses without a clock.
class PulseTimer : public firmware::UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40000400;

  PulseTimer(firmware::UnicornBoard& board, GpioPort& port_a, const InsulationDevice& device)
      : board_(board), port_a_(port_a), device_(device) {}
  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;
  void chip_reset() override;

  unsigned captures = 0;
  std::vector<std::string> violations;

 private:
  void catch_up(double now_us);
  void edge(bool rises, double at_us);
  bool connected() const;
  void check_clock(double now_us);

  firmware::UnicornBoard& board_;
  GpioPort& port_a_;
  const InsulationDevice& device_;
  std::map<std::uint32_t, std::uint32_t> registers_;
  std::uint32_t status_ = 0, period_ = 0, high_ = 0;
  double zero_us_ = 0, edge_us_ = 0, high_us_ = 0, low_us_ = 0;
  bool high_level_ = false;
};

}  // namespace bms::world
