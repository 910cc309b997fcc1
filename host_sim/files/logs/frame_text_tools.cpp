// Lines of PEAK's trace files and of BUSMASTER's logs, from their public descriptions.
#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

#include "files/logs/frame_text.hpp"
#include "files/logs/number.hpp"

namespace bms::files {

namespace {

constexpr double day_length_s = 86'400;

/// Bytes of a CAN FD frame by the code of its length.
constexpr std::array<std::uint32_t, 16> length_of_code = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

/// "13:33:13:8331": hours, minutes, seconds and ten thousandths.
bool clock_of(std::string_view text, double& time_s) {
  std::array<std::uint32_t, 4> part{};
  for (std::size_t k = 0; k < part.size(); ++k) {
    const std::size_t end = k + 1 < part.size() ? text.find(':') : text.size();
    if (end == std::string_view::npos || !number_in(text.substr(0, end), 10, part[k])) return false;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  constexpr double per_second = 10'000;
  time_s = 3'600.0 * part[0] + 60.0 * part[1] + part[2] + part[3] / per_second;
  return part[1] < 60 && part[2] < 60 && part[3] < per_second;
}

}  // namespace

bool FrameText::take_bytes(std::size_t first, std::size_t length, int base, TextFrame& frame) const {
  if (length > frame.data.size() || first + length > words_.size()) return false;
  for (std::size_t k = 0; k < length; ++k) {
    std::uint32_t value = 0;
    if (!number_in(words_[first + k], base, value) || value > 255) return false;
    frame.data[frame.length++] = static_cast<std::uint8_t>(value);
  }
  return true;
}

/// "$FILEVERSION=1.3" and "$COLUMNS=N,O,T,B,I,d,R,L,D" say what the words of a line are.
void FrameText::trc_header(std::string_view line) {
  const auto value_of = [&](std::string_view key) {
    return line.starts_with(key) ? line.substr(key.size()) : std::string_view{};
  };
  if (const std::string_view version = value_of(";$FILEVERSION="); !version.empty()) {
    trc_columns_ = "NOTIlD";  // 1.1
    if (version.starts_with("1.0")) trc_columns_ = "NOIlD";
    if (version.starts_with("1.2")) trc_columns_ = "NOBTIlD";
    if (version.starts_with("1.3")) trc_columns_ = "NOBTIRlD";
  }
  if (const std::string_view names = value_of(";$COLUMNS="); !names.empty()) {
    trc_columns_.clear();
    for (const char c : names)
      trc_columns_ += std::isalpha(static_cast<unsigned char>(c)) != 0 ? std::string(1, c) : "";
  }
}

/// One word of a frame of a trace file. Returns false if the line is not a data frame.
bool FrameText::take_trc(char column, std::string_view word, TextFrame& frame, std::uint32_t& length) const {
  switch (column) {
    case 'O': {
      const auto ms = number(word);
      if (!ms || !std::isfinite(*ms)) return false;
      frame.time_s = *ms / 1e3;
      return true;
    }
    case 'T': {
      constexpr std::array data = {"Rx", "Tx", "DT", "FD", "FB", "FE", "BI"};  // not: remote, status, error, warning
      return std::find(data.begin(), data.end(), word) != data.end();
    }
    case 'B':
      frame.channel = word;
      return true;
    case 'I':
      frame.long_id = word.size() > 4;
      return number_in(word, 16, frame.id) && frame.id <= (frame.long_id ? most_long_id : most_short_id);
    case 'l':
      return number_in(word, 10, length);
    case 'L':
      if (!number_in(word, 10, length) || length >= length_of_code.size()) return false;
      length = length_of_code[length];
      return true;
    default:
      return true;
  }
}

bool FrameText::parse_trc(std::string_view line, TextFrame& frame) {
  if (line.starts_with(";")) {
    trc_header(line);
    return false;
  }
  const bool typed = words_.size() > 2 && std::isdigit(static_cast<unsigned char>(words_[2].front())) == 0;
  const std::string without_header = typed ? "NOTIlD" : "NOIlD";
  const std::string& columns = trc_columns_.empty() ? without_header : trc_columns_;
  std::uint32_t length = 0, count = 0;
  if (!number_in(words_[0].substr(0, words_[0].find(')')), 10, count)) return false;
  for (std::size_t k = 0; k < columns.size(); ++k) {
    if (columns[k] == 'D') return take_bytes(k, length, 16, frame);
    if (k >= words_.size() || !take_trc(columns[k], words_[k], frame, length)) return false;
  }
  return length == 0;
}

bool FrameText::parse_busmaster(std::string_view line, TextFrame& frame) {
  if (line.starts_with("***")) {
    if (line.starts_with("***DEC***") || line.starts_with("***HEX***")) decimal_ = line[3] == 'D';
    if (line.find(" MODE***") != std::string_view::npos) relative_ = line.starts_with("***RELATIVE");
    return false;
  }
  double time_s = 0;
  constexpr std::size_t bytes = 6;  // "time Rx channel id type length bytes"
  if (words_.size() < bytes || !clock_of(words_[0], time_s)) return false;
  if (!relative_ && time_s + day_s_ < last_s_ - day_length_s / 2) day_s_ += day_length_s;
  last_s_ = relative_ ? last_s_ + time_s : time_s + day_s_;
  if (words_[4] != "s" && words_[4] != "x") return false;  // sr, xr: remote frames, whose time counts
  frame.time_s = last_s_;
  frame.channel = words_[2];
  frame.long_id = words_[4] == "x";
  const int base = decimal_ ? 10 : 16;
  std::uint32_t length = 0;
  if (!number_in(words_[3], base, frame.id) || frame.id > (frame.long_id ? most_long_id : most_short_id)) return false;
  return number_in(words_[5], 10, length) && take_bytes(bytes, length, base, frame);
}

}  // namespace bms::files
