#include "monitor/candump_line.hpp"

#include <algorithm>
#include <charconv>
#include <iterator>

#include <fmt/format.h>

#include "hal/slcan/codec.hpp"

namespace bms::monitor {

namespace {

using hal::slcan::digit;

constexpr std::uint32_t error_flag = 0x2000'0000, longest_id = 0x1FFF'FFFF;  // linux/can.h

/// Removes the first word and the spaces after it, and returns the word.
std::string_view take_word(std::string_view& rest) {
  const std::size_t end = std::min(rest.find(' '), rest.size());
  const std::string_view first = rest.substr(0, end);
  rest.remove_prefix(end);
  rest.remove_prefix(std::min(rest.find_first_not_of(' '), rest.size()));
  return first;
}

/// "(seconds.microseconds)"
bool parse_time(std::string_view text, std::int64_t& time_us) {
  if (text.size() < 4 || text.front() != '(' || text.back() != ')') return false;
  text = text.substr(1, text.size() - 2);
  const std::size_t dot = text.find('.');
  if (dot == std::string_view::npos || dot == 0 || dot > 11 || text.size() - dot - 1 != 6) return false;
  std::uint64_t seconds = 0;
  std::uint32_t microseconds = 0;
  const auto whole = [](std::string_view part, auto& value) {
    const auto end = part.data() + part.size();
    const auto read = std::from_chars(part.data(), end, value);
    return read.ec == std::errc{} && read.ptr == end;
  };
  if (!whole(text.substr(0, dot), seconds) || !whole(text.substr(dot + 1), microseconds)) return false;
  time_us = static_cast<std::int64_t>(seconds * 1'000'000 + microseconds);
  return true;
}

bool parse_id(std::string_view text, BusFrame& frame) {
  if (text.size() != 3 && text.size() != 8) return false;
  std::uint32_t id = 0;
  for (const char c : text) {
    if (digit(c) > 15) return false;
    id = id << 4 | digit(c);
  }
  frame.long_id = text.size() == 8;
  if (frame.long_id && (id & error_flag) != 0) {
    frame.kind = FrameKind::error;
    frame.long_id = false;
    id &= ~error_flag;
  }
  if (id > (text.size() == 8 ? longest_id : 0x7FFU)) return false;
  frame.id = id;
  return true;
}

/// Pairs of hexadecimal digits, with optional dots between them.
bool parse_data(std::string_view text, std::size_t most, BusFrame& frame) {
  std::size_t n = 0;
  for (std::size_t at = 0; at < text.size(); ++n) {
    if (n > 0 && text[at] == '.' && ++at == text.size()) return false;
    if (at + 1 >= text.size() || n >= most) return false;
    const unsigned high = digit(text[at]), low = digit(text[at + 1]);
    if (high > 15 || low > 15) return false;
    frame.data[n] = static_cast<std::uint8_t>(high << 4 | low);
    at += 2;
  }
  frame.length = static_cast<std::uint8_t>(n);
  return true;
}

bool parse_content(std::string_view text, BusFrame& frame) {
  if (!text.empty() && text[0] == '#') {
    if (text.size() < 2 || digit(text[1]) > 15 || frame.kind == FrameKind::error) return false;
    frame.kind = FrameKind::fd;
    frame.fd_flags = static_cast<std::uint8_t>(digit(text[1]));
    return parse_data(text.substr(2), 64, frame);
  }
  if (!text.empty() && text[0] == 'R') {
    if (text.size() > 2 || frame.kind == FrameKind::error || (text.size() == 2 && digit(text[1]) > 8)) return false;
    frame.kind = FrameKind::remote;
    frame.length = text.size() == 2 ? static_cast<std::uint8_t>(digit(text[1])) : std::uint8_t{0};
    return true;
  }
  if (frame.kind == FrameKind::standard && frame.long_id) frame.kind = FrameKind::extended;
  return parse_data(text, 8, frame);
}

}  // namespace

bool parse_dump_line(std::string_view line, BusFrame& frame) {
  BusFrame parsed;
  if (!parse_time(take_word(line), parsed.time_us)) return false;
  if (take_word(line).empty()) return false;  // interface
  const std::string_view content = take_word(line), direction = take_word(line);
  if (!line.empty() || !(direction.empty() || direction == "R" || direction == "T")) return false;
  const std::size_t mark = content.find('#');
  if (mark == std::string_view::npos || !parse_id(content.substr(0, mark), parsed) ||
      !parse_content(content.substr(mark + 1), parsed))
    return false;
  frame = parsed;
  return true;
}

void append_dump_line(std::string& text, const BusFrame& frame, std::string_view interface) {
  auto out = std::back_inserter(text);
  fmt::format_to(out, "({:010}.{:06}) {} ", frame.time_us / 1'000'000, frame.time_us % 1'000'000, interface);
  if (frame.kind == FrameKind::error)
    fmt::format_to(out, "{:08X}#", frame.id | error_flag);
  else if (frame.long_id)
    fmt::format_to(out, "{:08X}#", frame.id);
  else
    fmt::format_to(out, "{:03X}#", frame.id);
  if (frame.kind == FrameKind::fd) fmt::format_to(out, "#{:X}", frame.fd_flags & 15U);
  if (frame.kind == FrameKind::remote) {
    if (frame.length == 0)
      text += "R\n";
    else
      fmt::format_to(out, "R{:X}\n", frame.length);
    return;
  }
  for (std::size_t k = 0; k < frame.length; ++k) fmt::format_to(out, "{:02X}", frame.data[k]);
  text += '\n';
}

}  // namespace bms::monitor
