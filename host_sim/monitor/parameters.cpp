#include "monitor/parameters.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

namespace bms::monitor {

const std::vector<ParameterName>& parameter_names() {
  using V = can::ParameterValue;
  const auto number = [](std::uint32_t n) { return static_cast<std::uint8_t>(n); };
  static const std::vector<ParameterName> names{
      {number(V::number_cell_voltage_max), "cell_voltage_max", "V", 1e-3, 3},
      {number(V::number_cell_voltage_min), "cell_voltage_min", "V", 1e-3, 3},
      {number(V::number_charge_current_max), "charge_current_max", "A", 0.1, 1},
      {number(V::number_discharge_current_max), "discharge_current_max", "A", 0.1, 1},
      {number(V::number_temperature_max), "temperature_max", "degC", 0.1, 1},
      {number(V::number_temperature_min), "temperature_min", "degC", 0.1, 1},
      {number(V::number_charge_temperature_min), "charge_temperature_min", "degC", 0.1, 1},
      {number(V::number_voltage_delay), "voltage_delay", "s", 1e-3, 3},
      {number(V::number_temperature_delay), "temperature_delay", "s", 1e-3, 3},
      {number(V::number_capacity), "capacity", "Ah", 0.1, 1},
      {number(V::number_shunt), "shunt", "mohm", 1e-6, 6},
      {number(V::number_precharge_time), "precharge_time", "s", 1e-3, 3},
      {number(V::number_closing_difference), "closing_difference", "V", 1e-3, 3},
      {number(V::number_can_bit_rate), "can_bit_rate", "kbit/s", 1, 0},
      {number(V::number_can_base), "can_base", "", 1, 0, true},
      {number(V::number_can_stop), "can_stop", "", 1, 0, true},
      {number(V::number_canopen_node), "canopen_node", "", 1, 0},
      {number(V::number_canopen_charger), "canopen_charger", "", 1, 0},
      {number(V::number_inputs_fitted), "inputs_fitted", "", 1, 0},
      {number(V::number_group_node), "group_node", "", 1, 0},
      {number(V::number_group_batteries), "group_batteries", "", 1, 0}};
  return names;
}

const ParameterName* find_parameter(const std::string& name) {
  const auto found = std::ranges::find_if(parameter_names(), [&](const ParameterName& p) { return p.name == name; });
  return found == parameter_names().end() ? nullptr : &*found;
}

std::string text_of(const ParameterName& parameter, std::int32_t raw) {
  return parameter.hexadecimal ? fmt::format("{:#05x}", raw)
                               : fmt::format("{:.{}f}", parameter.scale * raw, parameter.digits);
}

std::int32_t raw_of(const ParameterName& parameter, double value) {
  return static_cast<std::int32_t>(std::lround(std::clamp(value / parameter.scale, -2e9, 2e9)));
}

bool ReceivedParameters::receive(const can::Frame& frame) {
  if (frame.long_id || frame.id != can::ParameterValue::id || !can::intact(frame, can::ParameterValue::data_id))
    return false;
  const auto m = can::ParameterValue::of(frame);
  Values& of = values_[static_cast<std::uint8_t>(m.number)];
  std::optional<std::int32_t>* const kinds[] = {&of.value, &of.lowest, &of.highest, &of.initial};
  if (m.kind >= std::size(kinds)) return false;
  return std::exchange(*kinds[m.kind], m.value) != m.value;
}

bool ReceivedParameters::complete() const {
  const auto block = values_.find(0);
  if (block == values_.end() || !block->second.complete()) return false;
  const std::int32_t count = *block->second.highest;
  if (count < 1 || values_.size() != static_cast<std::size_t>(count) + 1) return false;
  return std::ranges::all_of(values_, [](const auto& entry) { return entry.second.complete(); }) &&
         check_code(raw()) == static_cast<std::uint32_t>(*block->second.value);
}

std::vector<std::int32_t> ReceivedParameters::raw() const {
  std::vector<std::int32_t> all;
  for (const auto& [number, values] : values_) {
    if (number != 0) all.push_back(values.value.value_or(0));
  }
  return all;
}

std::string ReceivedParameters::state() const {
  constexpr const char* names[] = {"initial", "stored", "clamped", "lost"};
  const std::int32_t state = values_.at(0).initial.value_or(0);
  return names[std::clamp(state, 0, 3)];
}

can::Frame ReceivedParameters::request(std::uint8_t counter) {
  can::Command command;
  command.code = can::Command::code_read_parameters;
  return command.frame(counter);
}

std::uint32_t check_code(const std::vector<std::int32_t>& raw) {
  uLong crc = crc32(0, nullptr, 0);
  for (const std::int32_t value : raw) {
    const auto bits = static_cast<std::uint32_t>(value);
    const Bytef bytes[] = {static_cast<Bytef>(bits), static_cast<Bytef>(bits >> 8), static_cast<Bytef>(bits >> 16),
                           static_cast<Bytef>(bits >> 24)};
    crc = crc32(crc, bytes, sizeof(bytes));
  }
  return static_cast<std::uint32_t>(crc);
}

std::vector<can::Command> commands_to_set(const std::vector<std::int32_t>& now, const std::vector<std::int32_t>& raw) {
  std::vector<can::Command> commands;
  const auto add = [&](std::uint32_t code, std::uint32_t parameter, std::uint32_t argument) {
    can::Command c;
    c.code = code;
    c.parameter = parameter;
    c.argument = argument;
    commands.push_back(c);
  };
  add(can::Command::code_set_parameter, 0, 0);
  for (std::size_t k = 0; k < raw.size(); ++k) {
    if (k >= now.size() || raw[k] != now[k])
      add(can::Command::code_set_parameter, static_cast<std::uint32_t>(k + 1), static_cast<std::uint32_t>(raw[k]));
  }
  add(can::Command::code_apply_parameters, 0, check_code(raw));
  return commands;
}

}  // namespace bms::monitor
