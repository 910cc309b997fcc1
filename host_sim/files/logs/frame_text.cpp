#include "files/logs/frame_text.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>

#include "files/logs/number.hpp"
#include "files/logs/units.hpp"

namespace bms::files {

namespace {

bool add_byte(std::string_view text, int base, TextFrame& frame) {
  std::uint32_t value = 0;
  if (frame.length == frame.data.size() || !number_in(text, base, value) || value > 255) return false;
  frame.data[frame.length++] = static_cast<std::uint8_t>(value);
  return true;
}

bool set_id(std::string_view text, int base, bool long_id, TextFrame& frame) {
  if (!number_in(text, base, frame.id)) return false;
  frame.long_id = long_id || frame.id > most_short_id;
  return frame.id <= most_long_id;
}

bool is_direction(std::string_view word) {
  return word.size() > 2 &&
         (word.starts_with("RX") || word.starts_with("TX") || word.starts_with("rx") || word.starts_with("tx"));
}

}  // namespace

void split_words(std::string_view line, std::vector<std::string_view>& words) {
  words.clear();
  for (std::size_t k = 0; k < line.size();) {
    while (k < line.size() && std::isspace(static_cast<unsigned char>(line[k])) != 0) ++k;
    const std::size_t begin = k;
    while (k < line.size() && std::isspace(static_cast<unsigned char>(line[k])) == 0) ++k;
    if (k > begin) words.push_back(line.substr(begin, k - begin));
  }
}

bool number_in(std::string_view text, int base, std::uint32_t& value) {
  if (text.starts_with("0x") || text.starts_with("0X")) text.remove_prefix(2);
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

bool FrameText::parse(std::string_view line, TextFrame& frame) {
  frame.length = 0;
  frame.channel = {};
  if (format_ == "gvret") return parse_gvret(line, frame);
  split_words(line, words_);
  if (words_.empty()) return false;
  if (format_.empty() && line.starts_with("***BUSMASTER")) format_ = "busmaster";
  if (format_.empty() && line.starts_with(";$FILEVERSION")) format_ = "trc";
  if (format_ == "busmaster") return parse_busmaster(line, frame);
  if (format_ == "trc") return parse_trc(line, frame);
  if (format_.empty()) {
    if (line.starts_with("Time Stamp,ID,")) {
      format_ = "gvret";
      return parse_gvret(line, frame);
    }
    const bool asc = (words_.size() >= 3 && words_[0] == "base") || (words_.size() >= 4 && words_[0] == "date");
    if (asc) {
      format_ = "asc";
    } else if (words_[0].ends_with(')') && !words_[0].starts_with('(') && parse_trc(line, frame)) {
      format_ = "trc";
      return true;
    } else if (words_[0].starts_with('(') && parse_dump(frame)) {
      format_ = is_direction(words_[1]) ? "battery-emulator" : "candump";
      return true;
    } else {
      return false;
    }
  }
  return format_ == "asc" ? parse_asc(line, frame) : parse_dump(frame);
}

bool FrameText::parse_dump(TextFrame& frame) {
  if (words_.size() < 3 || !words_[0].starts_with('(') || !words_[0].ends_with(')')) return false;
  const auto time = number(words_[0].substr(1, words_[0].size() - 2));
  if (!time || std::isnan(*time)) return false;
  frame.time_s = *time;
  frame.channel = is_direction(words_[1]) ? words_[1].substr(2) : words_[1];
  const std::size_t hash = words_[2].find('#');
  if (hash == std::string_view::npos) {
    if (words_.size() < 4 || !words_[3].starts_with('[') || !set_id(words_[2], 16, words_[2].size() == 8, frame))
      return false;
    std::uint32_t length = 0;
    if (!number_in(words_[3].substr(1, words_[3].size() - 2), 10, length) || words_.size() - 4 < length) return false;
    for (std::size_t k = 0; k < length; ++k) {
      if (!add_byte(words_[4 + k], 16, frame)) return false;
    }
    return true;
  }
  if (!set_id(words_[2].substr(0, hash), 16, hash == 8, frame)) return false;
  std::string_view bytes = words_[2].substr(hash + 1);
  if (bytes.starts_with('#')) bytes.remove_prefix(std::min<std::size_t>(2, bytes.size()));  // CAN FD: a digit of flags
  if (bytes.size() % 2 != 0) return false;
  for (std::size_t k = 0; k < bytes.size(); k += 2) {
    if (!add_byte(bytes.substr(k, 2), 16, frame)) return false;
  }
  return true;
}

bool FrameText::parse_asc(std::string_view line, TextFrame& frame) {
  if (words_[0] == "base") {
    decimal_ = words_.size() > 1 && words_[1] == "dec";
    relative_ = line.find("timestamps relative") != std::string_view::npos;
    return false;
  }
  const auto time = number(words_[0]);
  if (!time || std::isnan(*time) || words_.size() < 6) return false;
  const bool fd = words_[1] == "CANFD";
  if (!fd && words_[4] != "d") return false;
  last_s_ = relative_ ? last_s_ + *time : *time;
  frame.time_s = last_s_;
  const int base = decimal_ ? 10 : 16;
  std::string_view id = words_[fd ? 4 : 2];
  frame.channel = words_[fd ? 2 : 1];
  const bool long_id = id.ends_with('x');
  if (long_id) id.remove_suffix(1);
  std::uint32_t length = 0;
  const std::size_t first = fd ? fd_data(length) : 6;
  if (first == 0 || !set_id(id, base, long_id, frame)) return false;
  if (!fd && !number_in(words_[5], 16, length)) return false;
  if (words_.size() - first < length) return false;
  for (std::size_t k = 0; k < length; ++k) {
    if (!add_byte(words_[first + k], base, frame)) return false;
  }
  return true;
}

/// "0.001036 CANFD 1 Rx 0c0 Name 1 0 d 32 00 00 ...": behind the identifier an optional name, two flags, the code of
/// the length and the length. Returns the index of the first byte; 0 if the line is not such a frame.
std::size_t FrameText::fd_data(std::uint32_t& length) const {
  for (const std::size_t flags : {std::size_t{5}, std::size_t{6}}) {
    if (words_.size() < flags + 4) return 0;
    const auto is_flag = [](std::string_view word) { return word == "0" || word == "1"; };
    if (!is_flag(words_[flags]) || !is_flag(words_[flags + 1]) || words_[flags + 2].size() != 1) continue;
    if (number_in(words_[flags + 3], 10, length)) return flags + 4;
  }
  return 0;
}

bool FrameText::parse_gvret(std::string_view line, TextFrame& frame) {
  const std::vector<std::string_view> fields = split(line, ',');
  if (columns_.empty()) {
    for (const std::string_view field : fields) columns_.push_back(normalised(field));
    return false;
  }
  std::uint32_t length = 0;
  std::size_t first = columns_.size();
  bool has_id = false;
  for (std::size_t k = 0; k < std::min(columns_.size(), fields.size()); ++k) {
    if (columns_[k] == "time stamp") {
      const auto us = number(fields[k]);
      if (!us || std::isnan(*us)) return false;
      frame.time_s = *us / 1e6;
    } else if (columns_[k] == "id") {
      has_id = set_id(fields[k], 16, false, frame);
    } else if (columns_[k] == "extended") {
      frame.long_id = fields[k] == "true" || fields[k] == "1";
    } else if (columns_[k] == "bus") {
      frame.channel = fields[k];
    } else if (columns_[k] == "len") {
      if (!number_in(fields[k], 10, length)) return false;
    } else if (columns_[k] == "d1") {
      first = k;
    }
  }
  if (!has_id || fields.size() < first + length) return false;
  for (std::size_t k = 0; k < length; ++k) {
    if (!add_byte(fields[first + k], 16, frame)) return false;
  }
  return true;
}

}  // namespace bms::files
