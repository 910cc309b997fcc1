// A line of a candump log (candump -L, candump -l), read and written:
//
//   (1436509052.249713) can0 182#0123456789ABCDEF     data; an id of 8 digits is a 29-bit one
//   (1436509052.249713) can0 182#R8                   remote request, length asked for
//   (1436509052.249713) can0 182##1001122             CAN FD: a digit of flags, then data
//   (1436509052.249713) can0 20000004#0004000000000000     error report
//
// A direction at the end (R or T, candump -x) is read over. Anything else is no frame. Total: any bytes may come.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "monitor/bus_frame.hpp"

namespace bms::monitor {

/// The longest line that can be a frame, and room to spare; what is longer is none.
inline constexpr std::size_t longest_dump_line = 512;

/// False: `line` (without its end) is no frame, and `frame` is as it was.
bool parse_dump_line(std::string_view line, BusFrame& frame);

/// Appends the line with its end. interface: without blanks.
void append_dump_line(std::string& text, const BusFrame& frame, std::string_view interface);

/// Collects bytes to lines, of bounded length: a longer one comes out empty and marked.
class DumpLines {
 public:
  /// True when `byte` ended a line, which line() holds until the next call.
  bool push(char byte) {
    if (ended_) {
      text_.clear();
      ended_ = too_long_ = false;
    }
    if (byte != '\n') {
      if (text_.size() < longest_dump_line)
        text_ += byte;
      else
        too_long_ = true;
      return false;
    }
    if (!text_.empty() && text_.back() == '\r') text_.pop_back();
    return ended_ = true;
  }
  std::string_view line() const { return too_long_ ? std::string_view{} : std::string_view{text_}; }
  bool too_long() const { return too_long_; }
  /// Whether a line without an end is left over.
  bool pending() const { return !ended_ && (!text_.empty() || too_long_); }

 private:
  std::string text_;
  bool ended_ = false, too_long_ = false;
};

}  // namespace bms::monitor
