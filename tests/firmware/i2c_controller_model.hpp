// Register model of ST's I2C controller (STM32F1 to F4), written from RM0090, 27: flags with the byte times of 400 kHz,
// a clock that is stretched while the program neither reads nor writes, and the acknowledge that the program must
// withdraw in time. The device on the bus is tests/hal/bq76952_model.
//
// A write reaches the device when it ends, as far as its bytes were acknowledged. A test can disturb the bus: a
// misplaced start or stop (BERR), a lost arbitration (ARLO), a written byte that is not acknowledged (AF). `violations`
// lists driver errors.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/firmware/unicorn_board.hpp"
#include "tests/hal/bq76952_model.hpp"

namespace bms::firmware {

class I2cControllerModel : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40005400;

  explicit I2cControllerModel(Bq76952Model& chip) : chip_(chip) {}

  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;

  unsigned bus_errors = 0;         ///< number of the next addresses with a misplaced start or stop
  unsigned arbitrations_lost = 0;  ///< number of the next addresses at which the controller loses the bus
  int bytes_until_refused = -1;    ///< written bytes that are acknowledged before one is not; -1: all are
  std::vector<std::string> violations;
  unsigned transfers = 0;
  std::uint32_t ccr = 0, trise = 0, frequency_mhz = 0;
  /// When the byte or condition on the wire ends; 0: nothing is on the wire.
  double ready_us() const { return ready_us_; }

 private:
  enum class Phase { idle, starting, started, addressing, addressed, sending, receiving };
  static constexpr double byte_us = 22.5, start_us = 2.5;

  void update(double now_us);
  void address_done();
  void byte_received(double then_us);
  void begin_reception(double now_us);
  void stop();
  void write_cr1(std::uint32_t value, double now_us);
  bool pending(double now_us) const { return ready_us_ > 0 && now_us >= ready_us_ && !chip_.hung; }

  Bq76952Model& chip_;
  Phase phase_ = Phase::idle;
  std::uint32_t cr1_ = 0, cr2_ = 0;
  double ready_us_ = 0;
  bool sb_ = false, address_ = false, received_ = false, shift_full_ = false, empty_ = false, refused_ = false,
       bus_error_ = false, arbitration_ = false, status_read_ = false, stop_wanted_ = false, reading_ = false,
       last_acked_ = false, dr_waits_ = false;
  std::uint8_t address_byte_ = 0, dr_ = 0, shift_ = 0;
  std::vector<std::uint8_t> out_;
  std::array<std::uint8_t, 96> in_{};
  std::size_t at_ = 0;
};

/// The I2C pins of port B: both wires high, or the clock held low.
class I2cPins : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40020400;

  explicit I2cPins(const Bq76952Model& chip) : chip_(chip) {}
  std::uint32_t read(std::uint32_t offset, double) override {
    if (offset != 0x10) return registers_[offset / 4];
    return chip_.hung ? 0x80 : 0xC0;
  }
  void write(std::uint32_t offset, std::uint32_t value, double) override { registers_[offset / 4] = value; }

 private:
  const Bq76952Model& chip_;
  std::array<std::uint32_t, 256> registers_{};
};

}  // namespace bms::firmware
