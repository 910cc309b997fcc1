// Parameters of a battery that a workshop sets over CAN, without a compiler: number, unit and range of each. Numbers
// never change their meaning.
//
//   number                   unit          range                                               tightens only
//   1  cell_voltage_max      mV            80 to 100 % of the span of the cell file            yes
//   2  cell_voltage_min      mV            0 to 40 % of the span                               yes
//   3  charge_current_max    0.1 A         a tenth of the cell file's limit to the limit       yes
//   4  discharge_current_max 0.1 A         the same                                            yes
//   5  temperature_max       0.1 degC      15 K below the cell file's limit to the limit       yes
//   6  temperature_min       0.1 degC      the cell file's limit to 20 K above, at most 0 degC yes
//   7  charge_temperature_min 0.1 degC     0 degC to 10 degC                                   yes
//   8  voltage_delay         ms            500 to 10,000: no row of a voltage waits longer     yes
//   9  temperature_delay     ms            1,000 to 5,000: no row of a temperature does        yes
//   10 capacity              0.1 Ah        half of the cell file's to the cell file's          yes; not the estimator's
//   11 shunt                 nohm          +-5 % of the board's                                of the wiring
//   12 precharge_time        ms            two samples to 4 s: resistor times DC link          of the wiring
//   13 closing_difference    mV            a quarter of the board's to the board's             yes
//   14 can_bit_rate          kbit/s        125, 250, 500, 1,000                                of the bus
//   15 can_base              identifier    0x100 to 0x7C0, a multiple of 0x40                  of the bus
//   16 can_stop              identifier    1 to 0x7FF                                          of the bus
//   17 canopen_node          node          the build's: only shown                             of the bus
//   18 canopen_charger       node          the build's: only shown                             of the bus
//   19 inputs_fitted         bits          those that the board has: 1 auxiliary contacts, 2 second current sensor,
//                                          4 key, 8 charger plug, 16 coil supply, 32 interlock, 64 crash sensor
//   20 group_node            node          1 to group_batteries; 0: not set, nothing closes    of the group
//   21 group_batteries       number        1 to 4, at one DC link; 0: not set                  of the group
//
// The last two are those of an image for one of several batteries (BMS_PARALLEL); others do not have them. A battery
// of a group sends and receives at can_base + 0x40 (group_node - 1) on the truck's bus.
//
// The initial values are those of the build. `tightened_plan.hpp` says what the limits do, and proves at compile time
// that every corner of their ranges gives a consistent table. Those of the bus are used from the next start on.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "protection/faults.hpp"
#include "protection/pack_design.hpp"

namespace bms::parameters {

enum class Parameter : std::uint8_t {
  cell_voltage_max = 1,
  cell_voltage_min,
  charge_current_max,
  discharge_current_max,
  temperature_max,
  temperature_min,
  charge_temperature_min,
  voltage_delay,
  temperature_delay,
  capacity,
  shunt,
  precharge_time,
  closing_difference,
  can_bit_rate,
  can_base,
  can_stop,
  canopen_node,
  canopen_charger,
  inputs_fitted,
  group_node,
  group_batteries
};
inline constexpr std::size_t parameter_count = protection::with_group ? 21 : 19;

/// Those of a truck begin with first_truck_input, in the order of hal::TruckInput.
inline constexpr std::int32_t auxiliary_contacts_fitted = 1, second_current_fitted = 2, first_truck_input = 4;

struct Range {
  std::int32_t lowest = 0, highest = 0, initial = 0;
  constexpr bool contains(std::int32_t value) const { return value >= lowest && value <= highest; }
};

/// One value each, by number minus 1.
using Values = std::array<std::int32_t, parameter_count>;
using Ranges = std::array<Range, parameter_count>;

constexpr std::size_t place(Parameter p) { return static_cast<std::size_t>(p) - 1; }
constexpr std::int32_t at(const Values& values, Parameter p) { return values[place(p)]; }
constexpr std::int32_t& at(Values& values, Parameter p) { return values[place(p)]; }
constexpr const Range& at(const Ranges& ranges, Parameter p) { return ranges[place(p)]; }

/// What the build states about the bus and the board.
struct BuildDefaults {
  std::int32_t bit_rate_kbit_s = 250, can_base = 0x180, can_stop = 0x0A0, canopen_node = 1, canopen_charger = 10;
  std::int32_t shunt_nohm = 100'000, inputs_fitted = 0;
};

inline constexpr std::int32_t most_batteries = 4;  ///< of a group
inline constexpr std::int32_t base_step = 0x40;    ///< identifiers from the base on, of the battery's own messages
inline constexpr std::int32_t last_base = 0x7C0;

/// Ranges for a pack. Limits that are no multiples of the unit are rounded to the safe side.
constexpr Ranges ranges_of(const protection::PackDesign& d, const BuildDefaults& build) {
  const auto down = [](double value) {
    const auto whole = static_cast<std::int32_t>(value);
    return whole > value ? whole - 1 : whole;
  };
  const auto up = [&](double value) { return -down(-value); };
  constexpr double rounding = 1e-6;
  const model::Limits& l = d.limits;
  const double span_v = l.voltage_max_v - l.voltage_min_v, freezing_c = std::max(l.temperature_min_c, 0.0);
  const auto tightened_down = [&](double most, double least) {
    return Range{down(least + rounding), down(most + rounding), down(most + rounding)};
  };
  const auto tightened_up = [&](double least, double most) {
    return Range{up(least - rounding), up(most - rounding), up(least - rounding)};
  };
  const double closing_mv = 1e3 * d.closing_current_max_a * d.closing_loop_ohm;
  const auto fixed = [](std::int32_t initial) { return Range{initial, initial, initial}; };
  const std::int32_t sample_ms = down(1e3 * d.sample_period_s + 0.5);
  std::array<Range, 21> all{tightened_down(1e3 * l.voltage_max_v, 1e3 * (l.voltage_max_v - 0.2 * span_v)),
                            tightened_up(1e3 * l.voltage_min_v, 1e3 * (l.voltage_min_v + 0.4 * span_v)),
                            tightened_down(10 * l.charge_current_max_a, l.charge_current_max_a),
                            tightened_down(10 * l.discharge_current_max_a, l.discharge_current_max_a),
                            tightened_down(10 * l.temperature_max_c, 10 * (l.temperature_max_c - 15)),
                            tightened_up(10 * l.temperature_min_c, 10 * std::min(l.temperature_min_c + 20, freezing_c)),
                            tightened_up(10 * freezing_c, 10 * (freezing_c + 10)),
                            Range{500, 10'000, 10'000},
                            Range{1'000, 5'000, 5'000},
                            tightened_down(10 * d.capacity_ah, 5 * d.capacity_ah),
                            Range{build.shunt_nohm / 20 * 19, build.shunt_nohm / 20 * 21, build.shunt_nohm},
                            Range{2 * sample_ms, 4'000, down(1e3 * d.precharge_time_constant_s + 0.5)},
                            tightened_down(closing_mv, closing_mv / 4),
                            Range{125, 1'000, build.bit_rate_kbit_s},
                            Range{0x100, last_base, build.can_base},
                            Range{1, 0x7FF, build.can_stop},
                            fixed(build.canopen_node),
                            fixed(build.canopen_charger),
                            Range{0, build.inputs_fitted, build.inputs_fitted},
                            Range{0, most_batteries, 0},
                            Range{0, most_batteries, 0}};
  Ranges ranges{};
  std::copy_n(all.begin(), ranges.size(), ranges.begin());
  return ranges;
}

constexpr Values initial_values(const Ranges& ranges) {
  Values values{};
  for (std::size_t k = 0; k < parameter_count; ++k) values[k] = ranges[k].initial;
  return values;
}

/// Returns true for a value that this parameter can have, whatever the others are.
constexpr bool possible(Parameter p, std::int32_t value, const Ranges& ranges) {
  const Range& range = at(ranges, p);
  if (!range.contains(value)) return false;
  if (p == Parameter::can_bit_rate) return value == 125 || value == 250 || value == 500 || value == 1'000;
  if (p == Parameter::can_base) return value % base_step == 0;
  if (p == Parameter::inputs_fitted) return (value & ~range.highest) == 0;
  return true;
}

/// Identifiers of the update of the firmware (firmware/boot/update_server.hpp), which do not move.
inline constexpr std::int32_t update_request = 0x7B0, update_response = 0x7B8;

/// What the messages of a node of a group begin with. node: 1 to most_batteries; 0: not set, as 1.
constexpr std::int32_t base_of(std::int32_t can_base, std::int32_t node) {
  return can_base + base_step * std::max(node - 1, std::int32_t{0});
}

/// Returns true if no two messages of the battery have the same identifier, and Stop wins the arbitration. 0x300 to
/// 0x33F are those of samples (hal/sample_frames.hpp); the others are those of a CANopen node
/// (firmware/cia418_profile.hpp) and of the update.
constexpr bool identifiers_are_unique(const Values& values) {
  const std::int32_t base = at(values, Parameter::can_base), stop = at(values, Parameter::can_stop),
                     node = at(values, Parameter::canopen_node), charger = at(values, Parameter::canopen_charger);
  if (node == charger || base == 0x300 || stop >= base) return false;
  const auto own = [&](std::int32_t id) { return id >= base && id < base + base_step; };
  if (own(stop) || (stop >= 0x300 && stop < 0x340)) return false;
  const std::int32_t of_others[] = {0x580 + node,    0x600 + node,    0x700 + node,   0x700 + charger, 0x200 + charger,
                                    0x300 + charger, 0x400 + charger, update_request, update_response};
  return std::ranges::none_of(of_others, [&](std::int32_t id) { return id == stop || own(id); });
}

/// Returns true if the group is not set, or the node is one of it, and all of its batteries have identifiers of their
/// own.
constexpr bool possible_group(const Values& values) {
  const std::int32_t node = at(values, Parameter::group_node), batteries = at(values, Parameter::group_batteries);
  if (node > batteries || (node == 0) != (batteries == 0)) return false;
  for (std::int32_t k = 1; k <= std::max(batteries, std::int32_t{1}); ++k) {
    Values of_node = values;
    at(of_node, Parameter::can_base) = base_of(at(values, Parameter::can_base), k);
    if (at(of_node, Parameter::can_base) > last_base || !identifiers_are_unique(of_node)) return false;
  }
  return true;
}
/// What several values must be together.
[[gnu::always_inline]] constexpr bool possible_together(const Values& values) {
  if constexpr (protection::with_group)
    return possible_group(values);
  else
    return identifiers_are_unique(values);
}

/// Bit rate and identifiers of a possible set in one word: 4 bits of 125 kbit/s, 5 bits of base_step, 11 bits of Stop;
/// in a group three bits each of node and number.
constexpr std::int32_t bus_setting(const Values& values) {
  std::int32_t word = at(values, Parameter::can_bit_rate) / 125 | at(values, Parameter::can_base) / base_step << 4 |
                      at(values, Parameter::can_stop) << 9;
  if constexpr (protection::with_group)
    word |= at(values, Parameter::group_node) << 20 | at(values, Parameter::group_batteries) << 23;
  return word;
}
/// The values may be impossible ones if the word is not of bus_setting().
constexpr void set_bus(Values& values, std::int32_t setting) {
  at(values, Parameter::can_bit_rate) = 125 * (setting & 0xF);
  at(values, Parameter::can_base) = base_step * (setting >> 4 & 0x1F);
  at(values, Parameter::can_stop) = setting >> 9 & 0x7FF;
  if constexpr (protection::with_group) {
    at(values, Parameter::group_node) = setting >> 20 & 7;
    at(values, Parameter::group_batteries) = setting >> 23 & 7;
  }
}

/// Returns true if all values are possible, also together.
constexpr bool possible(const Values& values, const Ranges& ranges) {
  for (std::size_t k = 0; k < parameter_count; ++k) {
    if (!possible(static_cast<Parameter>(k + 1), values[k], ranges)) return false;
  }
  return possible_together(values);
}

}  // namespace bms::parameters
