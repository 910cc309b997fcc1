#include "files/logs/dbc.hpp"

#include <bit>
#include <cmath>
#include <map>
#include <optional>
#include <regex>

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
                                  R"(\(([^,]+),([^)]+)\)\s*\[[^\]]*\]\s*"([^"]*)\")");
  return pattern;
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
  s.unit = m[9];
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

}  // namespace

std::vector<DbcSignal> read_dbc(const std::string& path) {
  TextLines lines(path);
  std::vector<DbcSignal> signals;
  std::string_view line;
  std::uint32_t id = 0;
  std::string message;
  while (lines.next(line)) {
    const std::string text(trimmed(line));
    std::smatch m;
    static const std::regex message_pattern(R"(^BO_\s+(\d+)\s+(\w+)\s*:)");
    static const std::regex type_pattern(R"(^SIG_VALTYPE_\s+(\d+)\s+(\w+)\s*:?\s*([12]))");
    const bool used = text.starts_with("SG_") || text.starts_with("BO_ ") || text.starts_with("SIG_VALTYPE_");
    if (!used) continue;
    try {
      if (text.size() > longest_line) throw std::invalid_argument(text);
      if (std::regex_search(text, m, message_pattern)) {
        id = static_cast<std::uint32_t>(std::stoul(m[1]));
        message = m[2];
      } else if (text.starts_with("SG_")) {
        auto signal = signal_of(text);
        if (!signal) throw std::invalid_argument(text);
        signal->message = message;
        signal->id = id & ~long_id_bit;
        signal->long_id = (id & long_id_bit) != 0;
        signals.push_back(*signal);
      } else if (std::regex_search(text, m, type_pattern)) {
        const auto of = static_cast<std::uint32_t>(std::stoul(m[1])) & ~long_id_bit;
        for (DbcSignal& s : signals) {
          if (s.id == of && s.name == m[2]) s.float_bits = m[3] == "1" ? 32 : 64;
        }
      }
    } catch (const std::exception&) {
      throw BadInput(path, lines.number(), in_quotes(text) + " is not a line of a DBC file, expected a signal");
    }
  }
  if (signals.empty()) throw BadInput(path, 1, "no signal, expected a DBC file");
  return signals;
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

double value_of(const DbcSignal& s, std::span<const std::uint8_t> data) {
  const std::uint64_t raw = raw_value(s, data);
  double value = static_cast<double>(raw);
  if (s.float_bits == 32) {
    value = static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw)));
  } else if (s.float_bits == 64) {
    value = std::bit_cast<double>(raw);
  } else if (s.is_signed) {
    const unsigned unused = 64 - s.length;
    value = static_cast<double>(static_cast<std::int64_t>(raw << unused) >> unused);
  }
  return value * s.factor + s.offset;
}

}  // namespace bms::files
