#include "files/recording.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <string_view>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::files {

using measurement::Recording;

namespace {

constexpr std::size_t minimum_rows = 10;
constexpr std::size_t longest_quote = 40;  ///< characters
constexpr double longest_s = 3.2e8;        ///< ten years
constexpr double largest_reading = 1e9;    ///< in any unit from microvolts to amperes
constexpr std::size_t most_ignored_named = 10;

/// Text of the file for a message: short and printable.
std::string in_quotes(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, longest_quote)) out += c >= ' ' && c <= '~' ? c : '?';
  return "'" + out + (text.size() > longest_quote ? "..." : "") + "'";
}

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') text = text.substr(1, text.size() - 2);
  return text;
}

/// Fast path for plain decimals of up to 15 digits: mantissa and power of ten are exact doubles, so the quotient is
/// correctly rounded. from_chars reads everything else.
std::optional<double> number(std::string_view text) {
  static constexpr std::array<double, 16> ten = {1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
  const char* at = text.data();
  const char* const end = at + text.size();
  const bool negative = at != end && *at == '-';
  if (negative) ++at;
  std::uint64_t mantissa = 0;
  std::size_t digits = 0, decimals = 0;
  for (; at != end && static_cast<unsigned char>(*at - '0') <= 9; ++at, ++digits)
    mantissa = mantissa * 10 + static_cast<std::uint64_t>(*at - '0');
  if (at != end && *at == '.') {
    for (++at; at != end && static_cast<unsigned char>(*at - '0') <= 9; ++at, ++decimals)
      mantissa = mantissa * 10 + static_cast<std::uint64_t>(*at - '0');
  }
  if (at == end && digits + decimals > 0 && digits + decimals <= 15) {
    const double value = static_cast<double>(mantissa) / ten[decimals];
    return negative ? -value : value;
  }
  text = trimmed(text);
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool too_small = error == std::errc::result_out_of_range && text.find("e-") != std::string_view::npos;
  if (too_small && stop == text.data() + text.size()) return 0.0;
  if (text.empty() || error != std::errc() || stop != text.data() + text.size() || std::isinf(value))
    return std::nullopt;
  return value;
}

/// One column, in the order of the file.
struct FileColumn {
  std::vector<double>* into = nullptr;  ///< nullptr: not used
  std::string name;
  bool sparse = false;  ///< a field may be empty, and is NaN then
};

class Parser {
 public:
  Parser(std::string_view text, const std::string& path) : rest_(text) {
    recording_.path = path;
    constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
    if (rest_.starts_with(byte_order_mark)) rest_.remove_prefix(byte_order_mark.size());
  }

  Recording parse(VoltageColumn voltage) {
    if (rest_.empty()) refuse("the file is empty", "a header line and rows");
    if (rest_.find('\0') != std::string_view::npos) refuse("not a text file", "a recording in CSV");
    header(voltage);
    reserve();
    while (next_line()) {
      if (recording_.rows() == measurement::most_rows)
        refuse("more rows", fmt::format("at most {}: split the recording", measurement::most_rows));
      row();
    }
    if (recording_.rows() < minimum_rows)
      refuse(fmt::format("{} rows", recording_.rows()), fmt::format("{} or more", minimum_rows));
    if (recording_.duration_s() <= 0) refuse("all rows have the same time", "times that increase");
    missing();
    return std::move(recording_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what, const std::string& expected) const {
    throw BadInput(recording_.path, std::max<std::size_t>(line_number_, 1), what + ", expected " + expected);
  }

  /// The next line that is neither empty nor a comment.
  bool next_line() {
    while (!rest_.empty()) {
      ++line_number_;
      const std::size_t end = rest_.find('\n');
      line_ = rest_.substr(0, end);
      rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
      if (!line_.empty() && line_.back() == '\r') line_.remove_suffix(1);
      const std::string_view content = trimmed(line_);
      if (!content.empty() && content.front() != '#') return true;
    }
    return false;
  }

  void header(VoltageColumn voltage) {
    if (!next_line()) refuse("only comments", "a header line and rows");
    separator_ = line_.find(';') != std::string_view::npos ? ';' : ',';
    std::string ignored;
    std::size_t ignored_count = 0;
    std::string_view names = line_;
    for (bool more = true; more;) {
      const std::size_t end = names.find(separator_);
      more = end != std::string_view::npos;
      columns_.push_back(column(std::string(trimmed(names.substr(0, end)))));
      if (columns_.back().into == nullptr && ++ignored_count <= most_ignored_named)
        ignored += (ignored.empty() ? "" : ", ") + in_quotes(columns_.back().name);
      if (more) names.remove_prefix(end + 1);
    }
    require("time_s");
    require("current_a");
    if (voltage == VoltageColumn::required) require("voltage_v");
    if (ignored_count > most_ignored_named) ignored += fmt::format(" and {} more", ignored_count - most_ignored_named);
    if (!ignored.empty()) recording_.warnings.push_back({"ignored_column", "columns not used: " + ignored});
  }

  FileColumn column(const std::string& name) {
    struct Known {
      std::string_view name;
      measurement::Column& into;
      bool sparse = false;
    };
    Recording& r = recording_;
    const Known known[] = {{"time_s", r.time_s},
                           {"current_a", r.current_a},
                           {"voltage_v", r.voltage_v},
                           {"temperature_c", r.temperature_c},
                           {"soc_ref", r.soc_ref},
                           {"current_ref_a", r.current_ref_a, true},
                           {"voltage_ref_v", r.voltage_ref_v, true}};
    FileColumn found{nullptr, name};
    for (const Known& one : known) {
      if (one.name == name) found = {&one.into.edit(), name, one.sparse};
    }
    if (found.into == nullptr) return found;
    for (const FileColumn& other : columns_) {
      if (other.into == found.into) refuse("column " + in_quotes(name) + " twice", "each column once");
    }
    return found;
  }

  void require(const char* name) const {
    for (const FileColumn& c : columns_) {
      if (c.name == name) return;
    }
    refuse(fmt::format("no column '{}' in {}", name, in_quotes(line_)), "a header with time_s, current_a, voltage_v");
  }

  void reserve() {
    const std::size_t line = rest_.find('\n') == std::string_view::npos ? 1 : rest_.find('\n') + 1;
    const std::size_t rows = std::min(measurement::most_rows, rest_.size() / std::max<std::size_t>(line, 8) + 1);
    for (const FileColumn& c : columns_) {
      if (c.into != nullptr) c.into->reserve(rows);
    }
  }

  void row() {
    std::string_view fields = line_;
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      const char* const found = static_cast<const char*>(std::memchr(fields.data(), separator_, fields.size()));
      const bool last = k + 1 == columns_.size();
      if (found == nullptr && !last)
        refuse(fmt::format("{} fields", k + 1), fmt::format("{} as in the header", columns_.size()));
      if (found != nullptr && last &&
          !trimmed({found + 1, fields.data() + fields.size()}).empty()) {  // a separator at the end is harmless
        refuse("more fields than the header has", fmt::format("{}", columns_.size()));
      }
      const std::size_t length = found == nullptr ? fields.size() : static_cast<std::size_t>(found - fields.data());
      if (columns_[k].into != nullptr) columns_[k].into->push_back(value(fields.substr(0, length), columns_[k]));
      if (!last) fields.remove_prefix(length + 1);
    }
    const measurement::Column& t = recording_.time_s;
    if (std::isnan(t.back())) refuse("time_s is not a number", "a time in seconds");
    if (t.size() > 1 && t.back() < t[t.size() - 2])
      refuse(fmt::format("time goes back from {:g} s to {:g} s", t[t.size() - 2], t.back()),
             "times that do not decrease");
    if (std::abs(t.back() - t.front()) > longest_s)
      refuse(fmt::format("time_s = {:g}", t.back()), "a recording of less than ten years");
  }

  double value(std::string_view field, const FileColumn& column) {
    if (column.sparse && trimmed(field).empty()) return std::numeric_limits<double>::quiet_NaN();
    const auto v = number(field);
    if (!v)
      refuse(fmt::format("{} in column '{}' is not a number", in_quotes(field), column.name),
             column.sparse ? "a number or nothing" : "a number");
    if (std::abs(*v) > largest_reading && column.name != "time_s") {
      refuse(fmt::format("{} in column '{}' is impossible", in_quotes(field), column.name),
             fmt::format("a value from -{:g} to {:g}, or nan", largest_reading, largest_reading));
    }
    if (std::isnan(*v) && !column.sparse && missing_++ == 0) first_missing_line_ = line_number_;
    return *v;
  }

  void missing() {
    if (missing_ > 0) {
      recording_.warnings.push_back(
          {"missing_reading",
           fmt::format("readings that are 'nan': {}, the first in line {}; they are treated as missing", missing_,
                       first_missing_line_)});
    }
  }

  std::string_view rest_, line_;
  std::size_t line_number_ = 0;
  char separator_ = ',';
  std::vector<FileColumn> columns_;
  std::size_t missing_ = 0, first_missing_line_ = 0;
  Recording recording_;
};

}  // namespace

Recording parse_recording(const std::string& text, const std::string& path, VoltageColumn voltage) {
  Recording recording = Parser(text, path).parse(voltage);
  measurement::check_recording(recording);
  return recording;
}

Recording read_recording(const std::string& path, VoltageColumn voltage) {
  const auto begin = std::chrono::steady_clock::now();
  const std::string text = read_file(path);
  Recording recording = parse_recording(text, path, voltage);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  recording.read_mb_per_second = static_cast<double>(text.size()) / 1e6 / seconds;
  return recording;
}

}  // namespace bms::files
