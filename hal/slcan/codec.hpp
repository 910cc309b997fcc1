// SLCAN, the text protocol of low-cost CAN adapters (Lawicel CAN232 manual), for the firmware and the host.
//
//   tIIILDD..\r        standard frame: 3 hex digits of identifier, length, data. Sends upper case, accepts either case.
//   TIIIIIIIILDD..\r   29-bit frame: 8 hex digits of identifier
//   rIIIL\r, RIIIIIIIIL\r   remote request: recognised, not used
//   O\r, C\r           open and close the channel
//   Sn\r, V\r, v\r, N\r, F\r   bit rate, versions, serial number, status
//
// Each line is answered by \r, after the requested text if there is one, or rejected by \a. A line that is too long, is
// not hexadecimal or has the wrong length is rejected as a whole and has no effect.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "hal/can.hpp"

namespace bms::hal::slcan {

inline constexpr std::size_t longest_frame = 1 + 8 + 1 + 16 + 1;

/// Writes a frame as text and returns the used part of `text`. A frame.length above 8 counts as 8.
constexpr std::string_view encode(const can::Frame& frame, std::array<char, longest_frame>& text) {
  constexpr std::string_view hex = "0123456789ABCDEF";
  std::size_t n = 0;
  text[n++] = frame.long_id ? 'T' : 't';
  for (int shift = frame.long_id ? 28 : 8; shift >= 0; shift -= 4)
    text[n++] = hex[static_cast<std::size_t>(frame.id >> shift) & 15U];
  const std::size_t length = frame.length < 8 ? frame.length : 8;
  text[n++] = hex[length];
  for (std::size_t k = 0; k < length; ++k) {
    text[n++] = hex[static_cast<std::size_t>(frame.data[k] >> 4)];
    text[n++] = hex[frame.data[k] & 15U];
  }
  text[n++] = '\r';
  return {text.data(), n};
}

/// Value of a hex digit; 16 for any other character.
constexpr unsigned digit(char c) {
  if (c >= '0' && c <= '9') return static_cast<unsigned>(c - '0');
  if (c >= 'A' && c <= 'F') return static_cast<unsigned>(c - 'A') + 10;
  if (c >= 'a' && c <= 'f') return static_cast<unsigned>(c - 'a') + 10;
  return 16;
}

/// line: without the final \r. Returns false, and leaves `frame` unchanged, if it is not a valid data frame.
constexpr bool decode(std::string_view line, can::Frame& frame) {
  if (line.empty() || (line[0] != 't' && line[0] != 'T')) return false;
  can::Frame decoded;
  decoded.long_id = line[0] == 'T';
  const std::size_t before_data = decoded.long_id ? 10 : 5;
  if (line.size() < before_data || digit(line[1]) > (decoded.long_id ? 1U : 7U)) return false;
  for (std::size_t k = 1; k + 1 < before_data; ++k) {  // no substr(): its exception would link much of the C library
    if (digit(line[k]) > 15) return false;
    decoded.id = decoded.id << 4 | digit(line[k]);
  }
  const unsigned length = digit(line[before_data - 1]);
  if (length > 8 || line.size() != before_data + 2 * length) return false;
  decoded.length = static_cast<std::uint8_t>(length);
  for (std::size_t k = 0; k < length; ++k) {
    const unsigned upper = digit(line[before_data + 2 * k]), lower = digit(line[before_data + 1 + 2 * k]);
    if (upper > 15 || lower > 15) return false;
    decoded.data[k] = static_cast<std::uint8_t>(upper << 4 | lower);
  }
  frame = decoded;
  return true;
}

/// Returns true if the line is a valid remote request, which decode() does not return.
constexpr bool is_other_frame(std::string_view line) {
  if (line.empty() || (line[0] != 'r' && line[0] != 'R')) return false;
  const std::size_t id_digits = line[0] == 'r' ? 3 : 8;
  if (line.size() != 2 + id_digits) return false;
  for (std::size_t k = 1; k < line.size(); ++k) {
    if (digit(line[k]) > 15) return false;
  }
  return digit(line[1 + id_digits]) <= 8 && digit(line[1]) <= (id_digits == 3 ? 7U : 1U);
}

/// Assembles lines from bytes.
class LineReader {
 public:
  /// Returns true if `byte` ended a line, which line() returns until the next call. A line that is too long is empty.
  constexpr bool push(char byte) {
    if (ended_) {
      length_ = 0;
      ended_ = too_long_ = false;
    }
    if (byte == '\n') return false;
    if (byte != '\r') {
      if (length_ < text_.size())
        text_[length_++] = byte;
      else
        too_long_ = true;
      return false;
    }
    if (too_long_) length_ = 0;
    ended_ = true;
    return true;
  }
  constexpr std::string_view line() const { return {text_.data(), length_}; }

 private:
  std::array<char, 32> text_{};
  std::size_t length_ = 0;
  bool too_long_ = false, ended_ = false;
};

}  // namespace bms::hal::slcan
