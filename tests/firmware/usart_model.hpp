// A register model of ST's USART (STM32F1 to F4), written from RM0090, 30.3.3 and 30.6. A received byte takes ten bit
// times. A byte that is complete before the last one was read is lost and sets ORE until SR and then DR are read. Bytes
// are transmitted at once.
#pragma once

#include <cstdint>
#include <string>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

class UsartModel : public UnicornBoard::Peripheral {
 public:
  static constexpr std::uint32_t base = 0x40011000;  ///< USART1
  static constexpr double clock_hz = 84e6;           ///< clock of APB2

  std::uint32_t read(std::uint32_t offset, double now_us) override;
  void write(std::uint32_t offset, std::uint32_t value, double now_us) override;
  int interrupt(double now_us) override;

  /// Bytes from the other side, without gaps.
  void receive(const std::string& bytes) { coming_ += bytes; }
  /// One more byte, which is complete between the reads of SR and DR for the last of the other bytes.
  void receive_between_the_reads(char byte) { between_ = byte; }

  bool interrupt_held = false;  ///< the interrupt is held off, as by a long one
  std::string sent;
  unsigned overruns = 0;

 private:
  void update(double now_us);
  void complete(char byte);
  double byte_us() const { return 1e6 * 10 * brr_ / clock_hz; }

  std::uint32_t brr_ = 0, cr1_ = 0, dr_ = 0;
  bool received_ = false, overrun_ = false, overrun_was_read_ = false;
  std::string coming_;
  double complete_us_ = -1;  ///< when the first byte of coming_ is complete; negative: not started
  int between_ = -1;
};

}  // namespace bms::firmware
