#include "files/logs/time_text.hpp"

#include <charconv>
#include <cmath>

namespace bms::files {

namespace {

constexpr double seconds_a_day = 86'400;

/// Reads a text from its beginning.
class Cursor {
 public:
  explicit Cursor(std::string_view text) : text_(text) {}

  bool integer(int& value) {
    const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), value);
    if (error != std::errc() || value < 0 || end - text_.data() > 9) return false;
    digits_ = static_cast<int>(end - text_.data());
    text_.remove_prefix(static_cast<std::size_t>(digits_));
    return true;
  }
  bool one_of(std::string_view characters, char& found) {
    if (text_.empty() || characters.find(text_.front()) == std::string_view::npos) return false;
    found = text_.front();
    text_.remove_prefix(1);
    return true;
  }
  bool one_of(std::string_view characters) {
    char found = 0;
    return one_of(characters, found);
  }
  /// Digits after a point or a comma, in units.
  double fraction() {
    if (text_.size() < 2 || (text_[0] != '.' && text_[0] != ',')) return 0;
    double value = 0, weight = 0.1;
    std::size_t k = 1;
    for (; k < text_.size() && text_[k] >= '0' && text_[k] <= '9'; ++k, weight /= 10)
      value += weight * (text_[k] - '0');
    // a decimal of up to nine digits, correctly rounded
    double power = 1;
    for (std::size_t i = 1; i < k; ++i) power *= 10;
    text_.remove_prefix(k);
    return std::round(value * power) / power;
  }
  void spaces() {
    while (!text_.empty() && text_.front() == ' ') text_.remove_prefix(1);
  }
  int digits() const { return digits_; }  ///< of the last integer
  bool ended() const { return text_.empty(); }
  std::string_view rest() const { return text_; }

 private:
  std::string_view text_;
  int digits_ = 0;
};

/// h:mm:ss[.f], or with `short_form` mm:ss[.f].
std::optional<double> time_of_day(Cursor& c, bool short_form) {
  int a = 0, b = 0, s = 0;
  if (!c.integer(a) || !c.one_of(":") || !c.integer(b) || b > 59) return std::nullopt;
  if (!c.one_of(":")) {
    if (short_form) return a * 60 + b + c.fraction();
    return a * 3'600.0 + b * 60;  // h:mm of a date
  }
  if (!c.integer(s) || s > 60) return std::nullopt;
  return a * 3'600.0 + b * 60 + s + c.fraction();
}

/// Days since 1970-01-01 in the Gregorian calendar.
std::optional<double> days_of(int year, int month, int day) {
  constexpr int length[] = {31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  if (month < 1 || month > 12 || day < 1 || day > length[month - 1] || year < 1970 || year > 2200) return std::nullopt;
  const int y = month <= 2 ? year - 1 : year;
  const int era = y / 400, of_era = y - era * 400;
  const int of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  const int day_of_era = of_era * 365 + of_era / 4 - of_era / 100 + of_year;
  return static_cast<double>(era * 146'097 + day_of_era - 719'468);
}

std::optional<double> days_of_text(Cursor& c, bool day_first) {
  int first = 0, second = 0, third = 0;
  char separator = 0, again = 0;
  if (!c.integer(first)) return std::nullopt;
  const bool year_first = c.digits() == 4;
  if (!c.one_of("-/.", separator) || !c.integer(second) || !c.one_of("-/.", again) || again != separator ||
      !c.integer(third))
    return std::nullopt;
  if (year_first) return days_of(first, second, third);
  if (third < 100) third += 2000;
  const bool day_leads = day_first || separator == '.' || first > 12;
  return day_leads ? days_of(third, second, first) : days_of(third, first, second);
}

/// The time of day with "AM" or "PM" behind it, or with nothing. Nothing for another text.
std::optional<double> half_day_s(double s, std::string_view rest) {
  if (rest.empty()) return s;
  const bool morning = rest == "AM" || rest == "am", afternoon = rest == "PM" || rest == "pm";
  if (!morning && !afternoon) return std::nullopt;
  return std::fmod(s, seconds_a_day / 2) + (afternoon ? seconds_a_day / 2 : 0);
}

/// Seconds to subtract: "Z", "+02:00", "-0500", or nothing.
std::optional<double> zone_s(Cursor& c) {
  char sign = 0;
  if (c.one_of("Zz")) return 0;
  if (!c.one_of("+-", sign)) return 0;
  int hours = 0, minutes = 0;
  if (!c.integer(hours)) return std::nullopt;
  if (c.digits() == 4) {
    minutes = hours % 100;
    hours /= 100;
  } else if (c.one_of(":") && !c.integer(minutes)) {
    return std::nullopt;
  }
  return (sign == '-' ? -1 : 1) * (hours * 3'600.0 + minutes * 60);
}

}  // namespace

std::optional<double> clock_s(std::string_view text) {
  double days_s = 0;
  Cursor all(text);
  int days = 0;
  if (Cursor c(text); c.integer(days) && c.one_of("-d")) {
    days_s = 86'400.0 * days;
    c.spaces();
    all = c;
  }
  const auto s = time_of_day(all, true);
  if (!s) return std::nullopt;
  all.spaces();
  const auto in_day = half_day_s(*s, all.rest());
  return in_day ? std::optional(days_s + *in_day) : std::nullopt;
}

std::optional<double> day_of_text_s(std::string_view text, bool day_first) {
  Cursor c(text);
  const auto days = days_of_text(c, day_first);
  return days && c.ended() ? std::optional(*days * seconds_a_day) : std::nullopt;
}

std::optional<double> date_s(std::string_view text, bool day_first) {
  Cursor c(text);
  const auto days = days_of_text(c, day_first);
  if (!days || !(c.one_of("T") || c.one_of(" "))) return std::nullopt;
  c.spaces();
  auto s = time_of_day(c, false);
  if (!s) return std::nullopt;
  c.spaces();
  if (const auto in_day = half_day_s(*s, c.rest())) return *days * seconds_a_day + *in_day;
  const auto zone = zone_s(c);
  if (!zone || !c.ended()) return std::nullopt;
  return *days * seconds_a_day + *s - *zone;
}

}  // namespace bms::files
