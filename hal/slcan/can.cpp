// CAN as SLCAN text over the board's UART. The channel is closed at boot; nothing is sent before the other side opens it.
#include "hal/can.hpp"

#include "hal/slcan/codec.hpp"
#include "hal/uart.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t baud = 921'600;
constexpr char done = '\r', refused = '\a';

slcan::LineReader reader;
bool listening = false;

void answer(char c) { uart_write({&c, 1}); }

/// A line that is not a frame.
void command(std::string_view line) {
  const char what = line.empty() ? '\0' : line[0];
  if (what == 'O') listening = true;
  if (what == 'C') listening = false;
  constexpr std::string_view known = "OCSsVvNFMmWQZ";
  answer(known.find(what) != std::string_view::npos ? done : refused);
}

}  // namespace

void can_start() {
  uart_start(baud);
  answer(done);  // "ready": an emulated UART drops what comes earlier
}

bool can_listening() { return listening; }

bool can_send(const CanFrame& frame) {
  if (!listening) return false;
  std::array<char, slcan::longest_frame> text;
  uart_write(slcan::encode(frame, text));
  return true;
}

bool can_receive(CanFrame& frame) {
  char byte = 0;
  while (uart_read(byte)) {
    if (!reader.take(byte)) continue;
    if (slcan::decode(reader.line(), frame)) return true;
    command(reader.line());
  }
  return false;
}

}  // namespace bms::hal
