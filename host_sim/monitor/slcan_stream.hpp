// Decodes the bytes of an SLCAN adapter to frames. Any bytes are safe.
//
// In addition to frames an adapter sends answers: an empty line, \a for a rejected command, z or Z for a sent frame,
// and the answers to V, v, N and F.
#pragma once

#include <cstdint>
#include <string_view>

#include "hal/slcan/codec.hpp"
#include "monitor/bus_frame.hpp"

namespace bms::monitor {

class SlcanStream {
 public:
  /// Returns true if `byte` completes a frame. The caller sets its time.
  bool push(char byte, BusFrame& frame) {
    if (byte == '\a' || !reader_.push(byte)) return false;
    const std::string_view line = reader_.line();
    can::Frame data;
    if (hal::slcan::decode(line, data)) {
      frame = to_bus_frame(data, 0);
      return true;
    }
    if (hal::slcan::is_other_frame(line)) {
      frame = remote_request(line);
      return true;
    }
    if (!line.empty() && std::string_view("zZVvNF").find(line[0]) == std::string_view::npos) ++malformed_;
    return false;
  }
  std::uint64_t malformed() const { return malformed_; }

 private:
  /// `line` must be a remote request.
  static BusFrame remote_request(std::string_view line) {
    BusFrame frame;
    frame.long_id = line[0] == 'R';
    frame.kind = FrameKind::remote;
    const std::size_t digits = frame.long_id ? 8 : 3;
    for (const char c : line.substr(1, digits)) frame.id = frame.id << 4 | hal::slcan::digit(c);
    frame.length = static_cast<std::uint8_t>(hal::slcan::digit(line[1 + digits]));
    return frame;
  }

  hal::slcan::LineReader reader_;
  std::uint64_t malformed_ = 0;
};

}  // namespace bms::monitor
