// Words, numbers, texts and signs of a DBC file, one after the other.
#pragma once

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace bms::files {

/// A decimal as in the file: units * 10^exponent is exactly its value.
struct Decimal {
  double value = 0;
  std::int64_t units = 0;
  int exponent = 0;
  bool exact = false;  ///< false: too many digits for units
};

/// Two decimals as multiples of one power of ten.
struct CommonUnits {
  std::int64_t a = 0, b = 0;  ///< multiples of 10^-digits
  int digits = 0;
};
/// Nothing if they do not fit: a product with 64 bits must have fewer than 128.
inline std::optional<CommonUnits> common_units(const Decimal& a, const Decimal& b) {
  constexpr int most_digits = 18;
  constexpr std::int64_t largest = std::int64_t{1} << 61;
  CommonUnits common{a.units, b.units, std::max({0, -a.exponent, -b.exponent})};
  if (!a.exact || !b.exact || common.digits > most_digits) return std::nullopt;
  for (const auto& [units, exponent] : {std::pair{&common.a, a.exponent}, std::pair{&common.b, b.exponent}}) {
    for (int k = exponent + common.digits; k > 0 && *units != 0; --k) {
      if (*units > largest / 10 || *units < -largest / 10) return std::nullopt;
      *units *= 10;
    }
  }
  return common;
}

/// Words that begin a section, at the beginning of a line.
inline constexpr std::array dbc_keywords = {"VERSION",
                                            "NS_",
                                            "BS_",
                                            "BU_",
                                            "VAL_TABLE_",
                                            "BO_",
                                            "SG_",
                                            "BO_TX_BU_",
                                            "EV_",
                                            "EV_DATA_",
                                            "ENVVAR_DATA_",
                                            "SGTYPE_",
                                            "SGTYPE_VAL_",
                                            "SIG_TYPE_REF_",
                                            "SIG_GROUP_",
                                            "CM_",
                                            "BA_DEF_",
                                            "BA_DEF_REL_",
                                            "BA_DEF_SGTYPE_",
                                            "BA_DEF_DEF_",
                                            "BA_DEF_DEF_REL_",
                                            "BA_",
                                            "BA_REL_",
                                            "BA_SGTYPE_",
                                            "VAL_",
                                            "CAT_DEF_",
                                            "CAT_",
                                            "FILTER",
                                            "SIG_VALTYPE_",
                                            "SIGTYPE_VALTYPE_",
                                            "SG_MUL_VAL_"};

inline bool is_dbc_keyword(std::string_view word) {
  return std::any_of(dbc_keywords.begin(), dbc_keywords.end(), [&](const char* keyword) { return word == keyword; });
}

/// Words that name what a comment or an attribute belongs to.
inline bool is_dbc_object(std::string_view word) {
  return word == "BU_" || word == "BO_" || word == "SG_" || word == "EV_";
}

/// Reads from the beginning of a text, which must outlive it. A method that finds something else returns nothing or
/// false and stays where it is.
class DbcScanner {
 public:
  explicit DbcScanner(std::string_view text) : text_(text) {}

  /// Skips spaces and line ends. Returns false at the end of the text.
  bool more() {
    while (at_ < text_.size() && is_space(text_[at_])) {
      if (text_[at_] == '\n') {
        ++line_;
        first_ = true;
      }
      ++at_;
    }
    return at_ < text_.size();
  }
  std::size_t line() const { return line_; }
  /// Returns true if only spaces are before this place in its line.
  bool first_of_line() {
    more();
    return first_;
  }
  std::size_t place() const { return at_; }
  std::string_view from(std::size_t place) const { return text_.substr(place, text_.find('\n', place) - place); }

  /// The next word without passing it: anything up to a space, a quote or one of ":;|@()[],".
  std::string_view peek() {
    if (!more()) return {};
    std::size_t end = at_;
    while (end < text_.size() && is_of_word(text_[end])) ++end;
    return text_.substr(at_, end - at_);
  }
  std::string_view word() {
    const std::string_view found = peek();
    pass(found.size());
    return found;
  }
  bool sign(char c) {
    if (!more() || text_[at_] != c) return false;
    pass(1);
    return true;
  }
  bool at(char c) { return more() && text_[at_] == c; }

  std::optional<std::uint64_t> whole() { return digits<std::uint64_t>(); }
  /// A signed number without decimals.
  std::optional<std::int64_t> integer() { return digits<std::int64_t>(); }
  std::optional<Decimal> decimal() {
    const std::string_view found = peek();
    const auto value = decimal_of(found);
    if (value) pass(found.size());
    return value;
  }
  /// "1-3": two numbers with a sign between them, with or without spaces.
  bool range(std::uint64_t& low, std::uint64_t& high) {
    if (!more()) return false;
    const std::size_t begin = at_;
    if (digits(low) && sign('-') && more() && digits(high)) return true;
    at_ = begin;
    return false;
  }

  /// A text in quotes, which may have several lines. A quote after a backslash belongs to it.
  std::optional<std::string_view> text() {
    if (!at('"') || open_text_) return std::nullopt;
    for (std::size_t end = at_ + 1; end < text_.size(); ++end) {
      if (text_[end] != '"' || (text_[end - 1] == '\\' && !ends_statement(end))) continue;
      return passed(end);
    }
    open_text_ = true;
    return std::nullopt;
  }
  /// The text of a comment: it ends at the quote before a semicolon. Quotes inside of it are accepted.
  std::optional<std::string_view> comment() {
    if (!at('"') || open_comment_) return std::nullopt;
    for (std::size_t end = at_ + 1; end < text_.size(); ++end) {
      if (text_[end] == '"' && ends_statement(end)) return passed(end);
    }
    open_comment_ = true;
    return std::nullopt;
  }
  /// Passes one sign, word or text. Returns false at the end of the file.
  bool skip() {
    if (!more()) return false;
    if (text()) return true;
    pass(std::max<std::size_t>(1, peek().size()));
    return true;
  }

 private:
  /// A word that is a number without decimals, and nothing else.
  template <class Number>
  std::optional<Number> digits() {
    const std::string_view found = peek();
    Number value = 0;
    const auto [end, error] = std::from_chars(found.data(), found.data() + found.size(), value);
    if (found.empty() || error != std::errc() || end != found.data() + found.size()) return std::nullopt;
    pass(found.size());
    return value;
  }
  static bool is_space(char c) { return c == ' ' || (c >= '\t' && c <= '\r'); }
  static bool is_of_word(char c) {
    constexpr std::string_view signs = "\":;|@()[],";
    return !is_space(c) && signs.find(c) == std::string_view::npos;
  }
  void pass(std::size_t count) {
    at_ += count;
    if (count > 0) first_ = false;
  }
  std::string_view passed(std::size_t end) {
    const std::string_view content = text_.substr(at_ + 1, end - at_ - 1);
    for (const char c : content) line_ += c == '\n' ? 1 : 0;
    pass(end + 1 - at_);
    return content;
  }
  bool ends_statement(std::size_t quote) const {
    const std::size_t next = text_.find_first_not_of(" \t\r\n", quote + 1);
    if (next == std::string_view::npos) return true;
    if (text_[next] != ';') return false;
    const std::size_t after = text_.find_first_not_of(" \t\r", next + 1);
    return after == std::string_view::npos || text_[after] == '\n';
  }
  bool digits(std::uint64_t& value) {
    const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
    if (error != std::errc()) return false;
    pass(static_cast<std::size_t>(end - (text_.data() + at_)));
    return true;
  }

  static std::optional<Decimal> decimal_of(std::string_view text) {
    if (text.starts_with('+')) text.remove_prefix(1);
    Decimal number;
    const char* const last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, number.value);
    const bool small = error == std::errc::result_out_of_range && text.find("e-") != std::string_view::npos;
    if (text.empty() || end != last || (error != std::errc() && !small) || !std::isfinite(number.value))
      return std::nullopt;
    number.exact = true;
    const bool negative = text.starts_with('-');
    bool point = false;
    std::size_t k = negative ? 1 : 0;
    for (; k < text.size() && text[k] != 'e' && text[k] != 'E'; ++k) {
      if (text[k] == '.') {
        point = true;
        continue;
      }
      constexpr std::int64_t most = 100'000'000'000'000'000;
      number.exact = number.exact && number.units < most;
      if (number.exact) number.units = number.units * 10 + (text[k] - '0');
      number.exponent -= point ? 1 : 0;
    }
    int exponent = 0;
    if (k < text.size()) {
      const std::size_t begin = k + (text.substr(k + 1).starts_with('+') ? 2 : 1);
      const auto [stop, wrong] = std::from_chars(text.data() + begin, last, exponent);
      number.exact = number.exact && wrong == std::errc() && std::abs(exponent) < 100;
    }
    number.exponent += exponent;
    while (number.units != 0 && number.units % 10 == 0) {
      number.units /= 10;
      ++number.exponent;
    }
    if (number.units == 0) number.exponent = 0;
    if (negative) number.units = -number.units;
    return number;
  }

  std::string_view text_;
  std::size_t at_ = 0, line_ = 1;
  bool first_ = true;
  bool open_text_ = false, open_comment_ = false;  ///< none of the quotes from here on ends a text, or a comment
};

}  // namespace bms::files
