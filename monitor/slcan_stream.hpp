// The bytes of an SLCAN adapter, decoded to frames. Total: any bytes may come.
//
// Beside frames an adapter sends answers: an empty line, \a where it refuses, z or Z for a frame it sent, and what V,
// v, N, F ask for.
#pragma once

#include <cstdint>
#include <string_view>

#include "hal/slcan/codec.hpp"
#include "monitor/bus_frame.hpp"

namespace bms::monitor {

class SlcanStream {
 public:
  /// True when `byte` completed a frame; its time is left to the caller.
  bool push(char byte, BusFrame& frame) {
    if (byte == '\a' || !reader_.push(byte)) return false;
    const std::string_view line = reader_.line();
    can::Frame data;
    if (hal::slcan::decode(line, data)) {
      frame = to_bus_frame(data, 0);
      return true;
    }
    if (hal::slcan::is_other_frame(line)) {
      frame = request(line);
      return true;
    }
    if (!line.empty() && std::string_view("zZVvNF").find(line[0]) == std::string_view::npos) ++malformed_;
    return false;
  }
  std::uint64_t malformed() const { return malformed_; }

 private:
  /// line: is_other_frame.
  static BusFrame request(std::string_view line) {
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
