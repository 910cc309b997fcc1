#include "files/logs/dbc.hpp"

#include <bit>
#include <cmath>
#include <cstdlib>
#include <optional>
#include <regex>
#include <stdexcept>
#include <utility>

#include "files/bad_input.hpp"
#include "files/logs/table_layout.hpp"
#include "files/logs/text_lines.hpp"

namespace bms::files {

namespace {

constexpr std::uint32_t long_id_bit = 0x8000'0000U;
/// Of lines with signals and messages: the library's regular expressions need some hundred bytes of stack a character.
constexpr std::size_t longest_line = 4'096;

/// Names of a group of digits in " SG_ Name m3 : 8|16@1- (0.1,-40) [0|0] "degC" ...".
const std::regex& signal_pattern() {
  static const std::regex pattern(R"(^\s*SG_\s+(\w+)\s*(M|m\d+M?)?\s*:\s*(\d+)\|(\d+)@([01])([+-])\s*)"
                                  R"(\(([^,]+),([^)]+)\)\s*\[([^\]|]*)\|?([^\]]*)\]\s*"([^"]*)\")");
  return pattern;
}

/// 0 if the text is not a number.
double number_of(const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return end != text.c_str() && std::isfinite(value) ? value : 0;
}

/// Decimals that two numbers need; -1: more than nine.
int digits_of(double a, double b) {
  double scale = 1;
  for (int digits = 0; digits <= 9; ++digits, scale *= 10) {
    const auto whole = [&](double v) {
      return std::abs(v * scale - std::round(v * scale)) <= 1e-9 * std::abs(v * scale);
    };
    if (whole(a) && whole(b)) return digits;
  }
  return -1;
}

std::optional<DbcSignal> signal_of(const std::string& line) {
  std::smatch m;
  if (!std::regex_search(line, m, signal_pattern())) return std::nullopt;
  DbcSignal s;
  s.name = m[1];
  const std::string multiplex = m[2];
  s.multiplexor = multiplex == "M" || (!multiplex.empty() && multiplex.back() == 'M');
  if (multiplex.starts_with('m')) s.multiplexed_by = std::stoi(multiplex.substr(1));
  s.start = static_cast<unsigned>(std::stoul(m[3]));
  s.length = static_cast<unsigned>(std::stoul(m[4]));
  s.little_endian = m[5] == "1";
  s.is_signed = m[6] == "-";
  s.factor = std::stod(m[7]);
  s.offset = std::stod(m[8]);
  s.digits = digits_of(s.factor, s.offset);
  s.lowest = number_of(m[9]);
  s.highest = number_of(m[10]);
  s.unit = m[11];
  if (s.length < 1 || s.length > 64 || s.start > 511 || !std::isfinite(s.factor) || !std::isfinite(s.offset))
    return std::nullopt;
  return s;
}

/// Place of bit k of the signal, from its least significant: byte and bit in the frame. Motorola counts from the most
/// significant bit downwards through a byte, then on to bit 7 of the next.
std::pair<std::size_t, unsigned> place_of(const DbcSignal& s, unsigned k) {
  if (s.little_endian) return {(s.start + k) / 8, (s.start + k) % 8};
  const unsigned from_top = s.length - 1 - k;
  const unsigned sequential = (s.start / 8) * 8 + (7 - s.start % 8) + from_top;
  return {sequential / 8, 7 - sequential % 8};
}

/// Signals line by line; what a line says of an earlier signal is added to it.
class Parser {
 public:
  void take(const std::string& text) {
    static const std::regex message_pattern(R"(^BO_\s+(\d+)\s+(\w+)\s*:)");
    static const std::regex type_pattern(R"(^SIG_VALTYPE_\s+(\d+)\s+(\w+)\s*:?\s*([12]))");
    static const std::regex invalid_pattern(R"(^BA_\s+"Invalid"\s+SG_\s+(\d+)\s+(\w+)\s+"?(-?\d+))");
    std::smatch m;
    if (std::regex_search(text, m, message_pattern)) {
      id_ = static_cast<std::uint32_t>(std::stoul(m[1]));
      message_ = m[2];
    } else if (text.starts_with("SG_")) {
      auto signal = signal_of(text);
      if (!signal) throw std::invalid_argument(text);
      signal->message = message_;
      signal->id = id_ & ~long_id_bit;
      signal->long_id = (id_ & long_id_bit) != 0;
      signals_.push_back(*signal);
    } else if (std::regex_search(text, m, type_pattern)) {
      for (DbcSignal* s : named(m[1], m[2])) s->float_bits = m[3] == "1" ? 32 : 64;
    } else if (std::regex_search(text, m, invalid_pattern)) {
      for (DbcSignal* s : named(m[1], m[2])) s->invalid = std::stoll(m[3]);
    }
  }
  std::vector<DbcSignal> signals() && { return std::move(signals_); }

 private:
  std::vector<DbcSignal*> named(const std::string& id, const std::string& name) {
    const auto of = static_cast<std::uint32_t>(std::stoul(id)) & ~long_id_bit;
    std::vector<DbcSignal*> found;
    for (DbcSignal& s : signals_) {
      if (s.id == of && s.name == name) found.push_back(&s);
    }
    return found;
  }

  std::uint32_t id_ = 0;
  std::string message_;
  std::vector<DbcSignal> signals_;
};

std::vector<DbcSignal> parse(TextLines& lines, const std::string& path) {
  Parser parser;
  std::string_view line;
  while (lines.next(line)) {
    const std::string text(trimmed(line));
    const bool used = text.starts_with("SG_") || text.starts_with("BO_ ") || text.starts_with("SIG_VALTYPE_") ||
                      text.starts_with("BA_ \"Invalid\"");
    if (!used) continue;
    try {
      if (text.size() > longest_line) throw std::invalid_argument(text);
      parser.take(text);
    } catch (const std::exception&) {
      throw BadInput(path, lines.number(), in_quotes(text) + " is not a line of a DBC file, expected a signal");
    }
  }
  std::vector<DbcSignal> signals = std::move(parser).signals();
  if (signals.empty()) throw BadInput(path, 1, "no signal, expected a DBC file");
  return signals;
}

}  // namespace

std::vector<DbcSignal> read_dbc(const std::string& path) {
  TextLines lines(path);
  return parse(lines, path);
}

std::vector<DbcSignal> parse_dbc(std::string_view text, const std::string& path) {
  TextLines lines(text, path);
  return parse(lines, path);
}

bool fits(const DbcSignal& s, std::size_t bytes) {
  return place_of(s, 0).first < bytes && place_of(s, s.length - 1).first < bytes;
}

std::uint64_t raw_value(const DbcSignal& s, std::span<const std::uint8_t> data) {
  std::uint64_t raw = 0;
  for (unsigned k = 0; k < s.length; ++k) {
    const auto [byte, bit] = place_of(s, k);
    raw |= std::uint64_t{(data[byte] >> bit) & 1U} << k;
  }
  return raw;
}

namespace {

std::int64_t extended(const DbcSignal& s, std::uint64_t raw) {
  const unsigned unused = 64 - s.length;
  return s.is_signed ? static_cast<std::int64_t>(raw << unused) >> unused : static_cast<std::int64_t>(raw);
}

}  // namespace

bool is_missing(const DbcSignal& s, std::span<const std::uint8_t> data) {
  constexpr unsigned shortest = 8;  // fewer bits have a meaning each
  const std::uint64_t raw = raw_value(s, data),
                      ones = s.length == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << s.length) - 1;
  const bool is_float = s.float_bits == 32 || s.float_bits == 64;
  if (!is_float && s.invalid && extended(s, raw) == *s.invalid) return true;
  if (!is_float && s.length >= shortest && raw == (s.is_signed ? ones / 2 + 1 : ones)) return true;
  const double value = value_of(s, data), rounding = is_float ? 0 : 0.5 * std::abs(s.factor);
  return s.highest > s.lowest && (value < s.lowest - rounding || value > s.highest + rounding);
}

double value_of(const DbcSignal& s, std::span<const std::uint8_t> data) {
  const std::uint64_t raw = raw_value(s, data);
  double value = static_cast<double>(raw);
  if (s.float_bits == 32) {
    value = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
  } else if (s.float_bits == 64) {
    value = std::bit_cast<double>(raw);
  } else if (s.is_signed) {
    value = static_cast<double>(extended(s, raw));
  }
  const double scaled = value * s.factor + s.offset;
  constexpr double exact = 9e15;  // whole numbers that a double can represent
  const double units = s.digits < 0 || s.float_bits != 0 ? exact : scaled * std::pow(10, s.digits);
  // 3.288, not the product 3.2880000000000003
  return std::abs(units) < exact ? std::round(units) / std::pow(10, s.digits) : scaled;
}

}  // namespace bms::files
