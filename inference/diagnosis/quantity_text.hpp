// Numbers as a technician reads them: rounded to their uncertainty, in a unit that suits their size.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "model/extended.hpp"

namespace bms::diagnosis {

/// Sizes at which a text changes its unit or its digits.
struct QuantityStyle {
  double milli_below = 1;          ///< volts, ohms, amperes and seconds below it are written in thousandths
  double seconds_below = 300;      ///< [s]
  double minutes_below = 10'000;   ///< [s]
  double undetermined_share = 30;  ///< without a standard deviation the last digit stands for the value over this
  double two_digits_below = 1.95;  ///< a standard deviation that begins with 1 has two digits
  int decimals_at_most = 6;
  double base = 10;                     ///< of the decimal system
  long long minutes_only_from_s = 600;  ///< durations from here on are written without seconds
  int two_decimals_below_mv = 1;        ///< small voltages
  int minute_s = 60, half_minute_s = 30, hour_s = 3'600;
};
inline constexpr QuantityStyle quantity_style{};

/// A number with its standard deviation: "12.4 ± 0.8 mV"; without it if deviation is 0. Keeps the sign.
std::string quantity(double value, double deviation, std::string_view unit);

/// The same for a parameter of a mechanism; shares and fractions in percent.
std::string parameter_text(const model::Parameter& parameter, double value, double deviation);

/// The same for the absolute value of a setting's parameter. unit: the parameter's own if empty.
std::string size_text(const model::MechanismSetting& setting, std::size_t parameter, std::string_view unit = "");

/// "a, b and c"; last: "and", "or".
std::string joined(const std::vector<std::string>& parts, const char* last);

/// "2:14 h", "3:05 min", "12 s".
std::string duration_text(double seconds);

/// "12.3 mV", below 1 mV with two decimals.
std::string millivolts(double volts);

/// With a capital letter at its beginning.
std::string capitalised(std::string text);

/// The digits in a parameter's name: the soc in percent that it belongs to ("slide_at_20" -> "20").
std::string number_in(std::string_view name);

}  // namespace bms::diagnosis
