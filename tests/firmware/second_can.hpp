// CAN2 of the chip, on a bus of its own (RM0090, 32): its registers without those of the filters, which are banks of
// CAN1. The time of its bus passes when the board asks for an interrupt, and before each access.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

class SecondCan : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40006800;
  static constexpr int tx_interrupt = 63, rx0_interrupt = 64;  // RM0090, table 61

  SecondCan(UnicornBoard& board, std::uint32_t bits_per_second) : board_(board) {
    can.filters_of = &board.can;
    can.bits_per_second = bits_per_second;
    board.plugged[base] = this;
  }
  std::uint32_t read(std::uint32_t offset, double now_us) override {
    pass(now_us);
    return clocked() && offset < filters ? can.read(offset) : 0;
  }
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override {
    pass(now_us);
    if (!clocked()) return can.violations.push_back("CAN2 is written without its clock and that of CAN1");
    if (offset >= filters) return can.violations.push_back("CAN2 has no filters");
    can.write(offset, value);
  }
  int interrupt(double now_us) override {
    pass(now_us);
    if (can.receive_interrupt()) return rx0_interrupt;
    return can.transmit_interrupt() ? tx_interrupt : -1;
  }
  void chip_reset() override { can.write(0, 1U << 15); }
  double ms_at_bit(std::uint64_t bit) const { return 1e3 * static_cast<double>(bit) / can.bits_per_second; }

  BxcanModel can;
  std::function<void()> falls;  ///< RX falls while the bus was idle

 private:
  static constexpr std::uint32_t filters = 0x200;

  bool clocked() const { return (board_.register_value(0x40023840) >> 25 & 3) == 3; }
  void pass(double now_us) {
    const auto until = static_cast<std::uint64_t>(1e-6 * now_us * can.bits_per_second);
    const auto apb1_hz = static_cast<std::uint32_t>(board_.rcc.apb1_hz());
    while (can.now_bit < until) {
      can.pass_quiet(std::min(can.quiet_bits(), until - can.now_bit - 1));
      can.bit(apb1_hz);
      if (!std::exchange(was_busy_, can.wire_busy()) && was_busy_ && falls) falls();
    }
    if (board_.stopped() && can.on_the_bus()) can.violations.push_back("CAN2 is on the bus when its clock stops");
  }

  UnicornBoard& board_;
  bool was_busy_ = false;
};

}  // namespace bms::firmware
