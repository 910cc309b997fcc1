// Register model of the ADC1 of the STM32F405. Written only from RM0090, 13, and the datasheet DS8626, 5.3.20 and
// 5.3.24: regular and injected sequences, single, scan and continuous conversion, sampling times, the end-of-conversion
// flags, overrun. Conversion to 6, 8 and 10 bits, the watchdog, DMA and external triggers are not modelled and are
// violations.
//
// While the program polls the status register, the time until the end of the conversion is skipped. The reference is
// VDDA, so a reading is the ratio of a pin to VDDA. `violations` lists driver errors.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "plant/random.hpp"
#include "tests/firmware/unicorn_board.hpp"

namespace bms::world {

class AdcModel : public firmware::UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40012000;
  static constexpr unsigned temperature_channel = 16, reference_channel = 17, battery_channel = 18;

  explicit AdcModel(firmware::UnicornBoard& board, std::uint64_t seed = 1) : board_(board), random_(seed) {}

  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;
  int interrupt(double now_us) override;
  void chip_reset() override { reset(); }
  void reset();

  std::function<double(unsigned channel)> pin_v = [](unsigned) { return 0.0; };  ///< channels 0 to 15
  std::function<bool(unsigned channel)> pin_is_analog = [](unsigned) { return true; };
  double vdda_v = 3.3;
  double reference_v = 1.2104;  ///< of this chip; its calibration word is 4095 times this divided by 3.3 V
  double noise_lsb = 0.7, offset_lsb = 0;
  std::vector<std::string> violations;
  std::uint64_t conversions = 0;

 private:
  struct Sequence {
    std::array<unsigned, 16> channel{};
    unsigned length = 0, at = 0;
    double done_us = -1;  ///< end of the conversion that runs; negative: none
    bool runs() const { return done_us >= 0; }
  };
  void update(double now_us);
  void start(bool injected, double now_us);
  void ends(bool injected);
  double conversion_us(unsigned channel) const;
  unsigned convert(unsigned channel);
  void write_cr2(std::uint32_t value, double now_us);
  void wrong(const char* what);

  firmware::UnicornBoard& board_;
  plant::Random random_;
  std::uint32_t sr_ = 0, cr1_ = 0, cr2_ = 0, ccr_ = 0, dr_ = 0;
  std::array<std::uint32_t, 2> smpr_{};
  std::array<std::uint32_t, 4> offsets_{}, injected_{};
  std::array<std::uint32_t, 3> sqr_{};
  std::uint32_t jsqr_ = 0;
  Sequence regular_, injected_sequence_;
  double powered_us_ = -1, reference_on_us_ = -1;
  unsigned idle_reads_ = 0;
};

}  // namespace bms::world
