#include "diagnosis/quantity_text.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace bms::diagnosis {

namespace {

constexpr const QuantityStyle& style = quantity_style;

struct Scale {
  double factor;
  std::string_view unit;
};

Scale time_scale(double size_s) {
  if (size_s < style.milli_below) return {1e3, " ms"};
  if (size_s < style.seconds_below) return {1, " s"};
  if (size_s < style.minutes_below) return {1.0 / 60, " min"};
  return {1.0 / 3'600, " h"};
}

/// The unit in which a number of this size is written.
Scale scale_of(double size, std::string_view unit) {
  const bool small = size < style.milli_below;
  if (unit == "V") return small ? Scale{1e3, " mV"} : Scale{1, " V"};
  if (unit == "ohm") return small ? Scale{1e3, " mOhm"} : Scale{1, " Ohm"};
  if (unit == "A") return small ? Scale{1e3, " mA"} : Scale{1, " A"};
  if (unit == "V/K") return {1e3, " mV/K"};
  if (unit == "J/mol") return {1e-3, " kJ/mol"};
  if (unit == "%") return {100, " %"};
  if (unit == "s") return time_scale(size);
  if (unit == "degC") return {1, " degrees C"};
  if (unit == "K") return {1, " K"};
  if (unit == "K/W") return {1, " K/W"};
  return {1, ""};
}

/// One digit of the standard deviation, two if it begins with 1; without one, two or three digits of the value.
int decimals(double value, double deviation) {
  const double last = deviation > 0 ? deviation : std::abs(value) / style.undetermined_share;
  if (!(last > 0) || !std::isfinite(last)) return 0;
  const double power = std::floor(std::log10(last));
  const bool begins_with_1 = last < style.two_digits_below * std::pow(style.base, power);
  return std::clamp(static_cast<int>(-power) + (begins_with_1 && deviation > 0 ? 1 : 0), 0, style.decimals_at_most);
}

}  // namespace

std::string quantity(double value, double deviation, std::string_view unit) {
  const Scale s = scale_of(std::abs(value), unit);
  const double e = deviation * s.factor;
  const int digits = decimals(value * s.factor, e);
  const double v =
      std::abs(value * s.factor) < 0.5 * std::pow(style.base, -digits) ? 0 : value * s.factor;  // no "-0.0"
  if (!(deviation > 0) || !std::isfinite(deviation)) return fmt::format("{:.{}f}{}", v, digits, s.unit);
  return fmt::format("{:.{}f} ± {:.{}f}{}", v, digits, e, digits, s.unit);
}

std::string parameter_text(const model::Parameter& p, double value, double deviation) {
  const bool share = p.unit == "1" && (p.role == model::Role::strength || p.name.ends_with("share") ||
                                       p.name.ends_with("fraction") || p.name == "knee");
  return quantity(value, deviation, share ? "%" : p.unit);
}

std::string size_text(const model::MechanismSetting& s, std::size_t k, std::string_view unit) {
  const model::Parameter& p = model::catalogue[s.index].parameter[k];
  return quantity(std::abs(s.value[k]), s.deviation[k], unit.empty() ? p.unit : unit);
}

std::string joined(const std::vector<std::string>& parts, const char* last) {
  std::string text;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (k > 0) text += k + 1 == parts.size() ? std::string(" ") + last + " " : ", ";
    text += parts[k];
  }
  return text;
}

std::string duration_text(double seconds) {
  const auto s = static_cast<long long>(std::llround(seconds));
  const long long minute = style.minute_s;
  if (s >= style.hour_s) return fmt::format("{}:{:02} h", s / style.hour_s, s / minute % minute);
  if (s < minute) return fmt::format("{} s", s);
  if (s % minute == 0 || s >= style.minutes_only_from_s)
    return fmt::format("{} min", (s + style.half_minute_s) / minute);
  return fmt::format("{}:{:02} min", s / minute, s % minute);
}

std::string millivolts(double v) {
  const bool small = std::abs(1e3 * v) < style.two_decimals_below_mv;
  return fmt::format("{:.{}f} mV", 1e3 * v, small ? 2 : 1);
}

std::string capitalised(std::string text) {
  if (!text.empty() && text[0] >= 'a' && text[0] <= 'z') text[0] = static_cast<char>(text[0] - 'a' + 'A');
  return text;
}

std::string number_in(std::string_view name) {
  std::string digits;
  for (const char c : name) {
    if (c >= '0' && c <= '9') digits += c;
  }
  return digits;
}

}  // namespace bms::diagnosis
