// A line of a candump log (candump -L, candump -l): parser and writer.
//
//   (1436509052.249713) can0 182#0123456789ABCDEF          data; an id of 8 digits has 29 bits
//   (1436509052.249713) can0 182#R8                        remote request with the requested length
//   (1436509052.249713) can0 182##1001122                  CAN FD: one digit of flags, then data
//   (1436509052.249713) can0 20000004#0004000000000000     error report
//
// A direction at the end (R or T, candump -x) is ignored. All other lines are rejected; any bytes are safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "monitor/bus_frame.hpp"

namespace bms::monitor {

/// Longer lines are not frames.
inline constexpr std::size_t longest_dump_line = 512;

/// Returns false, and leaves `frame` unchanged, if `line` is not a frame. `line` has no line end.
bool parse_dump_line(std::string_view line, BusFrame& frame);

/// Appends the line and its end. `interface` must not contain spaces.
void append_dump_line(std::string& text, const BusFrame& frame, std::string_view interface);

/// Splits bytes into lines of bounded length. A longer line is empty, and too_long() is true.
class DumpLines {
 public:
  /// Returns true if `byte` ends a line. line() is then valid until the next call.
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
    ended_ = true;
    return true;
  }
  std::string_view line() const { return too_long_ ? std::string_view{} : std::string_view{text_}; }
  bool too_long() const { return too_long_; }
  /// Returns true if the last line has no end yet.
  bool pending() const { return !ended_ && (!text_.empty() || too_long_); }

 private:
  std::string text_;
  bool ended_ = false, too_long_ = false;
};

}  // namespace bms::monitor
