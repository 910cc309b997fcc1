// CAN as SLCAN text over the board's UART. The channel is closed at boot; nothing is sent before the host opens it.
#include "hal/can.hpp"

#include "hal/slcan/codec.hpp"
#include "hal/uart.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t baud = 921'600;

slcan::LineReader reader;
bool listening = false;

void answer(std::string_view text) { uart_write({text.data(), text.size()}); }

/// Answer of an adapter to a line without a data frame; \a rejects the line.
std::string_view answer_to(std::string_view line) {
  if (slcan::is_other_frame(line)) return listening ? "\r" : "\a";
  if (line.size() == 2 && line[0] == 'S' && line[1] >= '0' && line[1] <= '8')
    return listening ? "\a" : "\r";  // not while open
  if (line.size() != 1) return "\a";
  switch (line[0]) {
    case 'O':
      listening = true;
      return "\r";
    case 'C':
      listening = false;
      return "\r";
    case 'V':
      return "V1010\r";  // hardware and software 1.0
    case 'v':
      return "v1010\r";
    case 'N':
      return "N0000\r";  // no serial number
    case 'F':
      return listening ? "F00\r" : "\a";  // a UART has no bus errors
    default:
      return "\a";
  }
}

}  // namespace

void can_start(const CanSettings&) {
  uart_start(baud);
  answer("\r");  // "ready": an emulated UART drops what comes earlier
}

bool can_listening() { return listening; }

bool can_send(const can::Frame& frame) {
  if (!listening) return false;
  std::array<char, slcan::longest_frame> text;
  answer(slcan::encode(frame, text));
  return true;
}

bool can_receive(can::Frame& frame) {
  char byte = 0;
  while (uart_read(byte)) {
    if (!reader.push(byte)) continue;
    const bool is_frame = slcan::decode(reader.line(), frame);
    if (is_frame)
      answer(listening ? "\r" : "\a");
    else
      answer(answer_to(reader.line()));
    if (is_frame && listening && !frame.long_id) return true;
  }
  return false;
}

// A UART has neither bus errors nor acknowledges, so only the state and the lost bytes are known.
CanHealth can_health() { return {.state = listening ? CanState::active : CanState::starting, .lost = uart_lost()}; }

}  // namespace bms::hal
