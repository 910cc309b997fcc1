#include "files/logs/units.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>

namespace bms::files {

namespace {

struct NamedTarget {
  std::string_view name;
  Quantity quantity;
};
constexpr std::array named_targets = {
    NamedTarget{"time_s", Quantity::time},
    NamedTarget{"current_a", Quantity::current},
    NamedTarget{"voltage_v", Quantity::voltage},
    NamedTarget{"temperature_c", Quantity::temperature},
    NamedTarget{"soc_ref", Quantity::soc_ref},
    NamedTarget{"current_ref_a", Quantity::current_ref},
    NamedTarget{"voltage_ref_v", Quantity::voltage_ref},
    NamedTarget{"pack_voltage_v", Quantity::pack_voltage},
    NamedTarget{"state", Quantity::state},
};

struct UnitName {
  std::string_view names;  ///< separated and surrounded by '|'
  Scale scale;
};
constexpr std::array time_units = {
    UnitName{"|s|sec|secs|second|seconds|", {}},
    UnitName{"|ms|msec|millisecond|milliseconds|", {1, 1e3, 0}},
    UnitName{"|us|usec|microsecond|microseconds|", {1, 1e6, 0}},
    UnitName{"|ns|nanosecond|nanoseconds|", {1, 1e9, 0}},
    UnitName{"|min|mins|minute|minutes|", {60, 1, 0}},
    UnitName{"|h|hr|hrs|hour|hours|", {3'600, 1, 0}},
    UnitName{"|d|day|days|", {86'400, 1, 0}},
};
constexpr std::array current_units = {
    UnitName{"|a|amp|amps|ampere|amperes|", {}},
    UnitName{"|ma|milliamp|milliampere|milliamperes|", {1, 1e3, 0}},
    UnitName{"|ca|", {1, 100, 0}},
    UnitName{"|ua|microampere|", {1, 1e6, 0}},
    UnitName{"|ka|", {1e3, 1, 0}},
};
constexpr std::array voltage_units = {
    UnitName{"|v|volt|volts|", {}}, UnitName{"|mv|millivolt|millivolts|", {1, 1e3, 0}},
    UnitName{"|cv|", {1, 100, 0}},  UnitName{"|uv|microvolt|", {1, 1e6, 0}},
    UnitName{"|kv|", {1e3, 1, 0}},
};
constexpr std::array temperature_units = {
    UnitName{"|c|degc|deg c|celsius|cel|", {}},
    UnitName{"|k|kelvin|", {1, 1, -273.15}},
    UnitName{"|f|degf|deg f|fahrenheit|", {5, 9, -160.0 / 9}},
};
constexpr std::array fraction_units = {
    UnitName{"|1|fraction|", {}},
    UnitName{"|%|percent|pct|", {1, 100, 0}},
    UnitName{"|ppm|", {1, 1e6, 0}},
};

template <std::size_t Count>
std::optional<Scale> find(const std::array<UnitName, Count>& units, const std::string& unit) {
  const auto at = std::find_if(units.begin(), units.end(), [&](const UnitName& u) {
    return u.names.find("|" + unit + "|") != std::string_view::npos;
  });
  if (unit.empty() || at == units.end()) return std::nullopt;
  return at->scale;
}

bool is_any_unit(const std::string& unit) {
  for (const Quantity q : {Quantity::time, Quantity::current, Quantity::voltage, Quantity::temperature}) {
    if (scale_of(q, unit)) return true;
  }
  return false;
}

void trim(std::string& text) {
  while (!text.empty() && text.back() == ' ') text.pop_back();
  text.erase(0, text.find_first_not_of(" ~"));
}

}  // namespace

std::optional<Target> target_of(std::string_view name) {
  for (const NamedTarget& one : named_targets) {
    if (one.name == name) return Target{one.quantity, 0};
  }
  if (!name.starts_with("v_") && !name.starts_with("t_")) return std::nullopt;
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(name.data() + 2, name.data() + name.size(), number);
  if (error != std::errc() || end != name.data() + name.size() || number < 1 || number > most_cells)
    return std::nullopt;
  return Target{name[0] == 'v' ? Quantity::cell_voltage : Quantity::cell_temperature, number};
}

std::string name_of(const Target& target) {
  if (target.quantity == Quantity::cell_voltage) return "v_" + std::to_string(target.number);
  if (target.quantity == Quantity::cell_temperature) return "t_" + std::to_string(target.number);
  for (const NamedTarget& one : named_targets) {
    if (one.quantity == target.quantity) return std::string(one.name);
  }
  return {};
}

std::optional<Scale> scale_of(Quantity quantity, std::string_view text) {
  const std::string unit = normalised(text);
  switch (quantity) {
    case Quantity::time:
      return find(time_units, unit);
    case Quantity::current:
    case Quantity::current_ref:
      return find(current_units, unit);
    case Quantity::temperature:
    case Quantity::cell_temperature:
      return find(temperature_units, unit);
    case Quantity::soc_ref:
      return find(fraction_units, unit);
    case Quantity::state:
      return std::nullopt;
    default:
      return find(voltage_units, unit);
  }
}

std::string unit_name(Quantity quantity, const std::string& unit) {
  const auto scale = scale_of(quantity, unit);
  std::string_view names = units_of(quantity);
  while (scale && !names.empty()) {
    const std::string_view name = names.substr(0, names.find(','));
    const auto of = scale_of(quantity, name);
    if (of && of->factor == scale->factor && of->divisor == scale->divisor && of->offset == scale->offset)
      return std::string(name);
    names.remove_prefix(std::min(names.size(), name.size() + 2));
  }
  return unit;
}

const char* units_of(Quantity quantity) {
  switch (quantity) {
    case Quantity::time:
      return "s, ms, us, ns, min, h, d";
    case Quantity::current:
    case Quantity::current_ref:
      return "A, mA, cA, uA, kA";
    case Quantity::temperature:
    case Quantity::cell_temperature:
      return "C, K, F";
    case Quantity::soc_ref:
      return "1, %, ppm";
    default:
      return "V, mV, cV, uV, kV";
  }
}

bool is_clock_unit(std::string_view unit) {
  const std::string text = normalised(unit);
  return text.find("h:m") != std::string::npos || text.find("hh:mm") != std::string::npos;
}

std::string normalised(std::string_view text) {
  std::string out;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const auto c = static_cast<unsigned char>(text[k]);
    const std::string_view rest = text.substr(k);
    if (rest.starts_with("\xE2\x84\x83")) {  // the single character for degrees Celsius
      out += "degc";
      k += 2;
    } else if (rest.starts_with("\xC2\xB0") || rest.starts_with("\xC2\xB5") || rest.starts_with("\xCE\xBC")) {
      out += c == 0xC2 && text[k + 1] == '\xB0' ? "deg" : "u";
      ++k;
    } else if (c == 0xB0 || c == 0xB5) {  // Latin-1
      out += c == 0xB0 ? "deg" : "u";
    } else if (c == '_' || c == ' ' || c == '\t') {
      if (!out.empty() && out.back() != ' ') out += ' ';
    } else {
      out += static_cast<char>(std::tolower(c));
    }
  }
  trim(out);
  return out;
}

Heading heading_of(std::string_view text) {
  std::string name = normalised(text);
  for (const auto& [open, close] : {std::pair{'(', ')'}, std::pair{'[', ']'}}) {
    const std::size_t from = name.find(open), to = name.find(close, from == std::string::npos ? 0 : from);
    if (from == std::string::npos || to == std::string::npos || from == 0) continue;
    Heading heading{name.substr(0, from) + name.substr(to + 1), name.substr(from + 1, to - from - 1)};
    trim(heading.base);
    trim(heading.unit);
    return heading;
  }
  std::size_t at = name.rfind('/');
  if (at == std::string::npos || !is_any_unit(normalised(name.substr(at + 1)))) at = name.rfind(' ');
  if (at == std::string::npos || at == 0) return {name, ""};
  Heading heading{name.substr(0, at), name.substr(at + 1)};
  trim(heading.base);
  trim(heading.unit);
  if (!is_any_unit(heading.unit) && heading.unit != "%") return {name, ""};
  return heading;
}

}  // namespace bms::files
