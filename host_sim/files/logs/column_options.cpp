#include "files/logs/column_options.hpp"

#include <charconv>

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/logs/table_layout.hpp"

namespace bms::files {

namespace {

std::optional<Target> target_or_group(std::string_view name) {
  if (name == "v_*") return Target{Quantity::cell_voltage, every_number};
  if (name == "t_*") return Target{Quantity::cell_temperature, every_number};
  return target_of(name);
}

}  // namespace

std::pair<Target, std::string> assignment(const std::string& text, const std::string& option) {
  const std::size_t equals = text.find('=');
  const auto target = target_or_group(trimmed(std::string_view(text).substr(0, equals)));
  if (equals == std::string::npos || !target) {
    throw BadInput(option, 1,
                   in_quotes(text) +
                       " names no column of a recording, expected NAME=... with time_s, current_a, "
                       "voltage_v, temperature_c, soc_ref, pack_voltage_v, v_1, t_1 or another of them");
  }
  return {*target, std::string(trimmed(std::string_view(text).substr(equals + 1)))};
}

bool holds_for(const Target& said, const Target& column) {
  const bool numbered = said.quantity == Quantity::cell_voltage || said.quantity == Quantity::cell_temperature;
  return said == column || (numbered && said.number == every_number && said.quantity == column.quantity);
}

std::vector<std::pair<std::size_t, std::size_t>> group_of(std::string_view pattern,
                                                          const std::vector<std::string>& headings) {
  std::vector<std::pair<std::size_t, std::size_t>> group;
  const std::string wanted = normalised(pattern);
  const std::size_t star = wanted.find('*');
  if (star == std::string::npos) return group;
  const std::string before = wanted.substr(0, star), after = wanted.substr(star + 1);
  for (std::size_t k = 0; k < headings.size(); ++k) {
    const std::string heading = normalised(headings[k]);
    if (heading.size() <= before.size() + after.size() || !heading.starts_with(before) || !heading.ends_with(after))
      continue;
    const char* const first = heading.data() + before.size();
    const char* const last = heading.data() + heading.size() - after.size();
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(first, last, number);
    if (error == std::errc() && end == last && number >= 1 && number <= most_cells) group.emplace_back(number, k);
  }
  return group;
}

std::optional<std::string> stated_unit(const std::vector<std::string>& unit_options, const Target& column) {
  for (const std::string& text : unit_options) {
    const auto [target, unit] = assignment(text, "--unit");
    if (holds_for(target, column)) return unit;
  }
  return std::nullopt;
}

std::optional<Scale> stated_scale(const std::vector<std::string>& unit_options, const Target& column) {
  const auto unit = stated_unit(unit_options, column);
  if (!unit) return std::nullopt;
  if (const auto scale = scale_of(column.quantity, *unit)) return scale;
  throw BadInput("--unit", 1,
                 fmt::format("{} is not a unit of {}, expected one of: {}", in_quotes(*unit), name_of(column),
                             units_of(column.quantity)));
}

}  // namespace bms::files
