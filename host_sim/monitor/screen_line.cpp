#include "monitor/screen_line.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace bms::monitor {

namespace {

/// Length of a UTF-8 character by its first byte.
std::size_t bytes_of(char first) {
  const auto byte = static_cast<unsigned char>(first);
  if (byte < 0x80) return 1;
  if (byte < 0xE0) return 2;
  return byte < 0xF0 ? 3 : 4;
}

std::size_t columns_of(std::string_view text) {
  std::size_t n = 0;
  for (std::size_t at = 0; at < text.size(); at += bytes_of(text[at])) ++n;
  return n;
}

}  // namespace

ScreenLine& ScreenLine::add(std::string_view text, TextStyle style) {
  if (text.empty()) return *this;
  if (!pieces_.empty() && pieces_.back().style == style)
    pieces_.back().text += text;
  else
    pieces_.push_back({std::string(text), style});
  return *this;
}

ScreenLine& ScreenLine::pad_to(std::size_t column) {
  const std::size_t now = columns();
  if (now < column) add(std::string(column - now, ' '));
  return *this;
}

ScreenLine& ScreenLine::append(const ScreenLine& other) {
  for (const Piece& piece : other.pieces_) add(piece.text, piece.style);
  return *this;
}

void ScreenLine::cut(std::size_t columns) {
  std::size_t left = columns;
  for (std::size_t k = 0; k < pieces_.size(); ++k) {
    std::string& text = pieces_[k].text;
    std::size_t at = 0;
    for (; at < text.size() && left > 0; --left) at += bytes_of(text[at]);
    text.resize(std::min(at, text.size()));
    if (text.empty()) {
      pieces_.resize(k);
      return;
    }
  }
}

std::size_t ScreenLine::columns() const {
  std::size_t n = 0;
  for (const Piece& piece : pieces_) n += columns_of(piece.text);
  return n;
}

std::string plain_text(const std::vector<ScreenLine>& lines) {
  std::string text;
  for (const ScreenLine& line : lines) {
    std::string whole;
    for (const auto& piece : line.pieces()) whole += piece.text;
    whole.erase(whole.find_last_not_of(' ') + 1);
    text += whole + "\n";
  }
  return text;
}

std::string ansi_frame(const std::vector<ScreenLine>& lines) {
  static constexpr std::array<const char*, 8> codes = {"",         "\x1b[90m",   "\x1b[1m",  "\x1b[32m",
                                                       "\x1b[33m", "\x1b[1;31m", "\x1b[34m", "\x1b[36m"};
  std::string text = "\x1b[?2026h\x1b[H";
  for (std::size_t k = 0; k < lines.size(); ++k) {
    if (k > 0) text += "\r\n";
    for (const auto& piece : lines[k].pieces()) {
      const char* code = codes[static_cast<std::size_t>(piece.style)];
      text += code + piece.text + (*code != '\0' ? "\x1b[0m" : "");
    }
    text += "\x1b[K";
  }
  return text + "\x1b[J\x1b[?2026l";
}

std::string printable(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    if (c < 0x20 || c > 0x7E) c = '?';
  }
  return out;
}

std::string age_text(double age_s) {
  if (!std::isfinite(age_s)) return "-";
  if (age_s < 9.95) return fmt::format("{:.1f} s", age_s);
  if (age_s < 100) return fmt::format("{:.0f} s", age_s);
  return age_s < 6'000 ? fmt::format("{:.0f} min", age_s / 60) : fmt::format("{:.0f} h", age_s / 3'600);
}

}  // namespace bms::monitor
