// Decimal numbers of a table.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "files/logs/table_layout.hpp"

namespace bms::files {

/// What from_chars reads: exponents, nan, many digits. Nothing for infinity and for text.
inline std::optional<double> any_number(std::string_view text, char point) {
  text = trimmed(text);
  std::string with_point;
  if (point != '.' && text.find(point) != std::string_view::npos) {
    with_point = text;
    for (char& c : with_point) c = c == point ? '.' : c;
    text = with_point;
  }
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool too_small = error == std::errc::result_out_of_range && text.find("e-") != std::string_view::npos;
  if (too_small && stop == text.data() + text.size()) return 0.0;
  if (text.empty() || error != std::errc() || stop != text.data() + text.size() || std::isinf(value))
    return std::nullopt;
  return value;
}

/// Fast path for plain decimals of up to 15 digits: mantissa and power of ten are exact doubles, so the quotient is
/// correctly rounded. point: '.' or ','.
inline std::optional<double> number(std::string_view text, char point = '.') {
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
  if (at != end && *at == point) {
    for (++at; at != end && static_cast<unsigned char>(*at - '0') <= 9; ++at, ++decimals)
      mantissa = mantissa * 10 + static_cast<std::uint64_t>(*at - '0');
  }
  if (at == end && digits + decimals > 0 && digits + decimals <= 15) {
    const double value = static_cast<double>(mantissa) / ten[decimals];
    return negative ? -value : value;
  }
  return any_number(text, point);
}

}  // namespace bms::files
