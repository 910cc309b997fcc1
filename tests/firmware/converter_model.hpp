// Register model of the chip's converter ADC1 (RM0090, 13), with a noise of one count. The voltages at its inputs come
// from a function of the channel; channel 17 is the internal reference of 1.21 V.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

class ConverterModel : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40012000;

  double supply_v = 3.27;
  std::function<double(std::uint32_t channel)> input_v;
  bool hangs = false;
  unsigned conversions = 0;
  std::vector<std::string> violations;

  std::uint32_t read(std::uint32_t at, double now_us) override {
    switch (at) {
      case 0x00:
        return begun_ && !hangs && now_us >= ready_us_ ? 2U : 0U;
      case 0x4C:
        if (!begun_ || now_us < ready_us_) violations.push_back("DR is read before the end of the conversion");
        begun_ = false;
        return value_;
      default:
        return registers_[at];
    }
  }
  void write(std::uint32_t at, std::uint32_t value, double now_us) override {
    registers_[at] = value;
    if (at == 0x08 && (value & 1U << 30) != 0) begin(now_us);
  }

 private:
  void begin(double now_us) {
    if ((registers_[0x08] & 1) == 0) violations.push_back("a conversion while the converter is off");
    const std::uint32_t channel = registers_[0x34] & 31;
    constexpr double cycles[] = {3, 15, 28, 56, 84, 112, 144, 480};
    const double sampling =
        cycles[channel < 10 ? registers_[0x10] >> (3 * channel) & 7 : registers_[0x0C] >> (3 * (channel - 10)) & 7];
    const double mhz = 84.0 / (2 * ((registers_[0x304] >> 16 & 3) + 1));
    if (mhz > 36) violations.push_back("a clock above 36 MHz (datasheet, ADC characteristics)");
    if (channel == 17 && ((registers_[0x304] & 1U << 23) == 0 || sampling / mhz < 10))
      violations.push_back("the reference is off, or sampled for less than 10 us");
    if (channel != 17 && sampling < 84) violations.push_back("a source of 28 kohm is sampled for less than 84 cycles");
    const double pin_v = channel == 17 ? 1.21 : input_v(channel);
    value_ =
        static_cast<std::uint32_t>(std::clamp(std::lround(4'095 * pin_v / supply_v + noise_(random_)), 0L, 4'095L));
    ready_us_ = now_us + (sampling + 12) / mhz;
    begun_ = true;
    ++conversions;
  }

  std::map<std::uint32_t, std::uint32_t> registers_;
  std::mt19937 random_{1};
  std::normal_distribution<double> noise_{0, 1};
  double ready_us_ = 0;
  std::uint32_t value_ = 0;
  bool begun_ = false;
};

}  // namespace bms::firmware
