// What a column of a log is, and in which unit.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace bms::files {

/// What the columns of a recording mean (measurement/recording.hpp).
enum class Quantity {
  time,
  current,
  voltage,
  temperature,
  soc_ref,
  current_ref,
  voltage_ref,
  pack_voltage,
  cell_voltage,      ///< v_1 .. v_N
  cell_temperature,  ///< t_1 .. t_M
  state,             ///< of a tester: "D" discharges, where the current has no sign
};

inline constexpr std::size_t most_cells = 1'000;

/// A column of a recording: a quantity, and for v_K and t_K the number from 1.
struct Target {
  Quantity quantity = Quantity::time;
  std::size_t number = 0;
  bool operator==(const Target&) const = default;
};

/// "current_a", "v_3"; nothing for another name.
std::optional<Target> target_of(std::string_view name);
/// The name of a column in a recording: "current_a", "v_3".
std::string name_of(const Target& target);

/// value * factor / divisor + offset: in the unit of the recording. Divisors keep decimal values correctly rounded.
struct Scale {
  double factor = 1, divisor = 1, offset = 0;
  bool neutral() const { return factor == 1 && divisor == 1 && offset == 0; }
  double operator()(double value) const { return value * factor / divisor + offset; }
};

/// Nothing if the text is not a unit of this quantity. Spelling: "mA", "Sec", "degC", "°C", "hours".
std::optional<Scale> scale_of(Quantity quantity, std::string_view unit);
/// The unit as it is usually written: "mA" for "milliamp"; the text itself if it is not a unit.
std::string unit_name(Quantity quantity, const std::string& unit);
/// Units for a message: "s, ms, us, min, h".
const char* units_of(Quantity quantity);
/// Returns true for "h:min:s.ms", "hh:mm:ss": the column has times of day.
bool is_clock_unit(std::string_view unit);

/// A heading of a column: "Current(mA)" is "current" in "ma".
struct Heading {
  std::string base;  ///< lower case, words separated by one space
  std::string unit;  ///< lower case; empty: not stated
};
Heading heading_of(std::string_view text);

/// Lower case; "_" and runs of spaces are one space; a degree sign is "deg", a micro sign "u".
std::string normalised(std::string_view text);

}  // namespace bms::files
