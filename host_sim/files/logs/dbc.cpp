#include "files/logs/dbc.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/table_layout.hpp"

namespace bms::files {

namespace {

__extension__ using Wide = __int128;

/// Place of bit k of the signal, from its least significant: byte and bit in the frame. Motorola counts from the most
/// significant bit downwards through a byte, then on to bit 7 of the next.
std::pair<std::size_t, unsigned> place_of(const DbcSignal& s, unsigned k) {
  if (s.little_endian) return {(s.start + k) / 8, (s.start + k) % 8};
  const unsigned from_top = s.length - 1 - k;
  const unsigned sequential = (s.start / 8) * 8 + (7 - s.start % 8) + from_top;
  return {sequential / 8, 7 - sequential % 8};
}

std::int64_t extended(const DbcSignal& s, std::uint64_t raw) {
  const unsigned unused = 64 - s.length;
  return s.is_signed ? static_cast<std::int64_t>(raw << unused) >> unused : static_cast<std::int64_t>(raw);
}

/// units * 10^-digits, correctly rounded: 3.288, not the product 3.2880000000000003.
double decimal(Wide units, int digits) {
  constexpr Wide exact = Wide{1} << 53;
  constexpr std::array ten = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8, 1e9,
                              1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18};
  if (-exact <= units && units <= exact) return static_cast<double>(units) / ten[static_cast<std::size_t>(digits)];
  constexpr std::size_t most_digits = 39;  // of 128 bits
  std::array<char, most_digits + 8> text{};
  std::size_t at = most_digits + 1;
  Wide rest = units < 0 ? -units : units;
  for (; rest != 0; rest /= 10) text[--at] = static_cast<char>('0' + static_cast<int>(rest % 10));
  if (units < 0) text[--at] = '-';
  char* const end = fmt::format_to(text.data() + most_digits + 1, "e-{}", digits);
  double value = 0;
  std::from_chars(text.data() + at, end, value);
  return value;
}

bool says_not_available(const DbcSignal& s, std::uint64_t raw) {
  const std::int64_t value = extended(s, raw);
  return (s.invalid && value == *s.invalid) ||
         std::find(s.not_available.begin(), s.not_available.end(), value) != s.not_available.end();
}

}  // namespace

std::vector<DbcSignal> multiplexors_of(const DbcSignal& signal, const std::vector<DbcSignal>& all,
                                       const std::string& path) {
  std::vector<DbcSignal> chain;
  std::string next = signal.multiplexor;
  while (!next.empty()) {
    const auto at = std::find_if(all.begin(), all.end(), [&](const DbcSignal& s) {
      return s.id == signal.id && s.long_id == signal.long_id && (s.name == next || s.short_name == next);
    });
    if (at == all.end()) {
      throw BadInput(path, signal.line,
                     fmt::format("{} is sent with some values of {} only, expected such a signal in {}",
                                 in_quotes(signal.name), in_quotes(next), in_quotes(signal.message)));
    }
    if (chain.size() == all.size())
      throw BadInput(path, signal.line, "the multiplexors of " + in_quotes(signal.name) + " select each other");
    chain.push_back(*at);
    next = at->multiplexor;
  }
  return chain;
}

bool is_sent(const DbcSignal& signal, std::span<const DbcSignal> multiplexors, std::span<const std::uint8_t> data) {
  const DbcSignal* selected = &signal;
  for (const DbcSignal& by : multiplexors) {
    if (!fits(by, data.size())) return false;
    const std::uint64_t raw = raw_value(by, data);
    const bool selects = std::any_of(selected->selected_by.begin(), selected->selected_by.end(),
                                     [&](const MultiplexRange& r) { return raw >= r.low && raw <= r.high; });
    if (!selects) return false;
    selected = &by;
  }
  return fits(signal, data.size());
}

bool is_of(const DbcSignal& s, std::uint32_t id, bool long_id) {
  if (s.long_id != long_id) return false;
  if (!s.any_source) return s.id == id;
  constexpr std::uint32_t group = 0x03FF'FF00, broadcast = 0x00F0'0000, destination = 0x0000'FF00;
  const std::uint32_t mask = (s.id & broadcast) == broadcast ? group : group & ~destination;
  return (s.id & mask) == (id & mask);  // neither priority nor source, of a message to one receiver not the receiver
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

bool is_missing(const DbcSignal& s, std::span<const std::uint8_t> data) {
  constexpr unsigned shortest = 8;  // fewer bits have a meaning each
  const std::uint64_t raw = raw_value(s, data),
                      ones = s.length == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << s.length) - 1;
  const bool is_float = s.float_bits == 32 || s.float_bits == 64;
  if (!is_float && says_not_available(s, raw)) return true;
  if (!is_float && s.length >= shortest && raw == (s.is_signed ? ones / 2 + 1 : ones)) return true;
  const double value = value_of(s, data), rounding = is_float ? 0 : 0.5 * std::abs(s.factor);
  return s.highest > s.lowest && (value < s.lowest - rounding || value > s.highest + rounding);
}

double value_of(const DbcSignal& s, std::span<const std::uint8_t> data) {
  const std::uint64_t raw = raw_value(s, data);
  if (s.float_bits == 32)
    return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(raw))) * s.factor + s.offset;
  if (s.float_bits == 64) return std::bit_cast<double>(raw) * s.factor + s.offset;
  const Wide value = s.is_signed ? Wide{extended(s, raw)} : Wide{raw};
  if (s.digits >= 0) return decimal(value * s.factor_units + s.offset_units, s.digits);
  return static_cast<double>(value) * s.factor + s.offset;
}

}  // namespace bms::files
