// Register model of a GPIO port and of the interrupt lines EXTI0 to EXTI16 and EXTI22 of the STM32F405. Written only
// from RM0090, 8.4, 9.2.4 and 12.3.
//
// A pin that is not an output floats: the pull-downs of the drivers decide its level. `violations` lists driver errors.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::world {

enum class Level { low, high, floating };

class GpioPort : public firmware::UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t first_base = 0x40020000;
  static constexpr std::uint32_t base(unsigned port) { return first_base + 0x400 * port; }

  /// port: 0 is port A.
  GpioPort(const firmware::UnicornBoard& board, unsigned port) : board_(board), port_(port) { reset(); }

  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;
  void chip_reset() override { reset(); }
  void reset();

  /// What the pin drives.
  Level driven(unsigned pin) const;
  bool analog(unsigned pin) const { return (mode_ >> 2 * pin & 3) == 3; }
  /// Level of the wire while the pin does not drive it.
  void set_outside(unsigned pin, bool high);
  bool outside(unsigned pin) const { return (outside_ >> pin & 1) != 0; }

  std::uint64_t writes = 0;  ///< that may have changed what the pins drive
  std::vector<std::string> violations;

 private:
  const firmware::UnicornBoard& board_;
  unsigned port_;
  std::uint32_t mode_ = 0, open_drain_ = 0, speed_ = 0, pull_ = 0, output_ = 0, outside_ = 0xFFFF;
  std::array<std::uint32_t, 2> alternate_{};
};

class ExtiModel : public firmware::UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40013C00;
  static constexpr unsigned supply_line = 16, clock_line = 22;

  explicit ExtiModel(const firmware::UnicornBoard& board) : board_(board) {}

  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;
  int interrupt(double now_us) override;
  void chip_reset() override { mask_ = rising_ = falling_ = pending_ = 0; }

  /// An edge of pin `line` of a port, which counts if SYSCFG selects this port.
  void pin_edge(unsigned port, unsigned line, bool rises);
  void line_edge(unsigned line, bool rises);

 private:
  const firmware::UnicornBoard& board_;
  std::uint32_t mask_ = 0, rising_ = 0, falling_ = 0, pending_ = 0;
};

}  // namespace bms::world
