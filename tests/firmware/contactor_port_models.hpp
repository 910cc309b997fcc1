// Register models of the ports around the contactors, written from RM0090: the outputs PC6 to PC9 (8.4), the auxiliary
// contacts at PB14 and PB15, and their interrupts EXTI14 and EXTI15 (12.3).
#pragma once

#include <array>
#include <cstdint>

#include "tests/firmware/i2c_controller_model.hpp"

namespace bms::firmware {

/// Port C: BSRR sets and resets bits of ODR; set wins. The inputs of the truck are at PC2 to PC5 and PC13.
class ContactorPort : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40020800;

  std::uint32_t read(std::uint32_t offset, double) override { return offset == 0x10 ? inputs : registers_[offset / 4]; }
  void write(std::uint32_t offset, std::uint32_t value, double) override {
    if (offset == 0x18)
      registers_[0x14 / 4] = (registers_[0x14 / 4] & ~(value >> 16)) | (value & 0xFFFF);
    else
      registers_[offset / 4] = value;
  }
  void chip_reset() override { registers_ = {}; }
  std::uint32_t output() const { return registers_[0x14 / 4]; }
  std::uint32_t mode() const { return registers_[0]; }

  std::uint32_t inputs = 1U << 4 | 1U << 5 | 1U << 13;  ///< no key, no charger plug

 private:
  std::array<std::uint32_t, 256> registers_{};
};

/// Port B with the pins of I2C, and the auxiliary contacts: low while the main contact is closed.
class AuxiliaryPins : public I2cPins {
 public:
  using I2cPins::I2cPins;

  void set_contacts(bool plus_closed, bool minus_closed) {
    const std::uint32_t before = open_;
    open_ = (plus_closed && !stuck_open ? 0 : 1U << 14) | (minus_closed && !stuck_open ? 0 : 1U << 15);
    risen_ |= open_ & ~before;
  }
  std::uint32_t read(std::uint32_t offset, double now_us) override {
    return I2cPins::read(offset, now_us) | (offset == 0x10 ? open_ : 0);
  }
  std::uint32_t pull_ups() { return I2cPins::read(0x0C, 0); }
  /// Rising edges since the last call.
  std::uint32_t take_risen() {
    const std::uint32_t edges = risen_;
    risen_ = 0;
    return edges;
  }

  bool stuck_open = false;

 private:
  std::uint32_t open_ = 3U << 14, risen_ = 0;
};

/// EXTI14 and EXTI15 of port B. The line of the supply's detector is not modelled here.
class ContactInterrupt : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40013C00;

  explicit ContactInterrupt(AuxiliaryPins& pins) : pins_(pins) {}
  std::uint32_t read(std::uint32_t offset, double) override {
    return offset == 0x14 ? pending_ : registers_[offset / 4];
  }
  void write(std::uint32_t offset, std::uint32_t value, double) override {
    if (offset == 0x14)
      pending_ &= ~value;  // written 1 to clear
    else
      registers_[offset / 4] = value;
  }
  int interrupt(double) override {
    constexpr std::uint32_t imr = 0, rtsr = 2;
    pending_ |= pins_.take_risen() & registers_[rtsr];
    return (pending_ & registers_[imr]) != 0 ? 40 : -1;
  }

 private:
  AuxiliaryPins& pins_;
  std::array<std::uint32_t, 256> registers_{};
  std::uint32_t pending_ = 0;
};

}  // namespace bms::firmware
