#include "tests/firmware/usart_model.hpp"

namespace bms::firmware {

namespace {

constexpr std::uint32_t sr = 0x00, dr = 0x04, brr = 0x08, cr1 = 0x0C;
constexpr std::uint32_t overrun = 1U << 3, received = 1U << 5, sent_and_free = 3U << 6;  // SR: TC, TXE
constexpr std::uint32_t receiver = 1U << 2, receive_interrupt = 1U << 5, on = 1U << 13;  // CR1
constexpr int usart1_interrupt = 37;

}  // namespace

/// A byte is complete in the shift register: it is moved to DR, or it is lost.
void UsartModel::complete(char byte) {
  if (received_) {
    overrun_ = true;
    ++overruns;
    return;
  }
  dr_ = static_cast<unsigned char>(byte);
  received_ = true;
}

void UsartModel::update(double now_us) {
  if ((cr1_ & on) == 0 || (cr1_ & receiver) == 0) return;
  while (!coming_.empty()) {
    if (complete_us_ < 0) complete_us_ = now_us + byte_us();
    if (complete_us_ > now_us) return;
    complete(coming_.front());
    coming_.erase(0, 1);
    complete_us_ += byte_us();
  }
  complete_us_ = -1;
}

std::uint32_t UsartModel::read(std::uint32_t offset, double now_us) {
  update(now_us);
  switch (offset) {
    case sr: {
      overrun_was_read_ = overrun_;
      const std::uint32_t value = sent_and_free | (received_ ? received : 0) | (overrun_ ? overrun : 0);
      if (received_ && coming_.empty() && between_ >= 0) {
        complete(static_cast<char>(between_));
        between_ = -1;
      }
      return value;
    }
    case dr:
      received_ = false;
      if (overrun_was_read_) overrun_ = overrun_was_read_ = false;
      return dr_;
    case brr:
      return brr_;
    case cr1:
      return cr1_;
    default:
      return 0;
  }
}

void UsartModel::write(std::uint32_t offset, std::uint32_t value, double now_us) {
  update(now_us);
  switch (offset) {
    case dr:
      sent += static_cast<char>(value);
      return;
    case brr:
      brr_ = value;
      return;
    case cr1:
      cr1_ = value;
      return;
    default:
      return;
  }
}

int UsartModel::interrupt(double now_us) {
  update(now_us);
  return !interrupt_held && (cr1_ & receive_interrupt) != 0 && (received_ || overrun_) ? usart1_interrupt : -1;
}

}  // namespace bms::firmware
