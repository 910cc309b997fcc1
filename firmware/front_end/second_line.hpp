// Thresholds and delays of the measuring chip's own protections, the second line, from those of the first line: the
// rows of protection's table. The second line is wider and slower, so that warning, derating and grace time come first.
// Only its comparator for short circuits is faster.
//
//   chip                  threshold                                  delay
//   cell overvoltage      20 mV above cell overvoltage severe        0.8 s more than that row
//   cell undervoltage     20 mV below deep discharge, so that a       the same
//                         recovery charge is possible above it
//   charge overcurrent    1.2 times short circuit, or the end of      0.42 s
//                         the comparator: at least 3 times the
//                         continuous current and 1.05 of a rated pulse
//   discharge overcurrent 1.2 and 1.5 times short circuit, or the     0.42 s, 0.35 s
//                         end of the comparator
//   sustained overcurrent 2 times the continuous current              20 s, discharge; 36 s if the cell
//                                                                     file rates this current for 30 s
//   hot                   5 K above charge overtemperature and        20 s
//                         above overtemperature
//   cold                  5 K below charge undertemperature           20 s, charge
//   short circuit         2 times short circuit, at least the         0.45 ms, discharge
//                         current that main plus makes
//
// The first line needs at most first_line_s for the row short circuit: two means of 100.5 ms, as its filter is not
// synchronous to the current, a sample period and the processing of a sample.
//
// Every protection that the chip has for a hazard of the pack is on for every cell file; for a cell file with which one
// of them would be narrower or faster than the first line, the image does not compile. A temperature opens like the
// others, but is a state and not a trip (protection.hpp).
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "hal/bq76952/configuration.hpp"
#include "protection/overload.hpp"
#include "protection/table.hpp"

namespace bms::firmware {

inline constexpr double voltage_margin_v = 0.02, slower_by_s = 0.8;
inline constexpr double overcurrent_ratio = 1.2, high_overcurrent_ratio = 1.5, short_circuit_ratio = 2;
inline constexpr double sustained_ratio = 2, sustained_delay_s = 20;  ///< of the continuous discharge current
inline constexpr double least_charge_ratio = 3;                       ///< of the continuous charge current
inline constexpr double grace_s = 5, chain_s = 0.5;                   ///< of the first line, and of its samples
inline constexpr int temperature_margin_c = 5;
inline constexpr std::uint8_t temperature_delay_s = 20;
inline constexpr double overcurrent_delay_s = 0.42, high_overcurrent_delay_s = 0.35;
/// A calibration may lower a reading by 5 %; the row must still be reached at the end of the sensor's range.
inline constexpr double range_ratio = 1.06;

constexpr double first_line_s(double ratio, double sample_period_s) {
  constexpr double mean_s = 0.1005, processing_s = 0.05;
  return mean_s + mean_s / ratio + sample_period_s + processing_s;
}

constexpr const protection::Rule& rule_of(const protection::Rules& rules, protection::Fault fault) {
  return rules[static_cast<std::size_t>(fault)];
}

/// Time after which the first line has opened under this discharge current, by its overload integral and its grace
/// time. A calibration may lower a reading by 5 %.
constexpr double overload_opens_s(const protection::PackDesign& pack, double current_a) {
  constexpr double least_reading = 0.95;
  const protection::OverloadPlan plan = protection::overload_plan(
      pack.pulses.discharge, pack.limits.discharge_current_max_a, pack.pulses.temperature_min_c);
  const double over_l =
      least_reading * current_a / (protection::overcurrent_from * pack.limits.discharge_current_max_a);
  const auto times_256 = std::min(static_cast<std::int32_t>(256 * over_l), protection::most_times_256);
  if (times_256 <= 256) return std::numeric_limits<double>::infinity();
  const auto rate = static_cast<double>(protection::overload_rates(plan, times_256, true).largest()) / 65'536;
  return 1e-6 * protection::full_overload_us / rate + grace_s + chain_s;
}

/// The threshold stays where it is; the chip waits longer if the cell file rates this current for longer. The chip's
/// threshold is a whole number of steps.
constexpr double sustained_delay(const protection::PackDesign& pack) {
  constexpr double step = 0.02;
  const double first_s = overload_opens_s(pack, (1 - step) * sustained_ratio * pack.limits.discharge_current_max_a);
  const auto whole_s = static_cast<double>(static_cast<int>(first_s));
  return std::max(sustained_delay_s, whole_s < first_s ? whole_s + 1 : whole_s);
}

/// Board around the chip for this pack, the lower one of two. rules: those of its table.
constexpr hal::bq76952::Board front_end_board(const protection::PackDesign& pack, const protection::Rules& rules) {
  using enum protection::Fault;
  const protection::Rule &high = rule_of(rules, cell_overvoltage_severe),
                         &low = rule_of(rules, cell_undervoltage_severe);
  const double short_a = 1e-6 * rule_of(rules, short_circuit).threshold;
  const auto celsius = [&](protection::Fault fault) { return rule_of(rules, fault).threshold / 100; };
  return {.current_range_a = std::max(327.0, range_ratio * short_a),
          .cell_inputs = hal::bq76952::inputs_of_pack(hal::bq76952::lower_cells(pack.cells)),
          .four_thermistors = pack.cells <= hal::bq76952::cell_inputs,
          .overvoltage_v = 1e-6 * high.threshold + voltage_margin_v,
          .undervoltage_v = 1e-6 * rule_of(rules, deep_discharge).threshold - voltage_margin_v,
          .voltage_delay_s = 1e-6 * std::max(high.delay_us, low.delay_us) + slower_by_s,
          .overcurrent_a = overcurrent_ratio * short_a,
          .overcurrent_delay_s = overcurrent_delay_s,
          .high_overcurrent_a = high_overcurrent_ratio * short_a,
          .high_overcurrent_delay_s = high_overcurrent_delay_s,
          .short_circuit_a = std::max(short_circuit_ratio * short_a, pack.closing_current_max_a),
          .sustained_a = sustained_ratio * pack.limits.discharge_current_max_a,
          .sustained_delay_s = sustained_delay(pack),
          .charge_hot_c = celsius(charge_overtemperature) + temperature_margin_c,
          .discharge_hot_c = celsius(overtemperature) + temperature_margin_c,
          .charge_cold_c = celsius(charge_undertemperature) - temperature_margin_c,
          .temperature_delay_s = temperature_delay_s};
}

/// What the chip will do, as its settings say: thresholds and delays in SI units.
struct SecondLine {
  double overvoltage_v, overvoltage_s, undervoltage_v, undervoltage_s;
  double charge_overcurrent_a, charge_overcurrent_s, overcurrent_a, overcurrent_s, high_overcurrent_a,
      high_overcurrent_s, short_circuit_a, host_silence_s;
  double sustained_a, sustained_s;
  int charge_hot_c, discharge_hot_c, charge_cold_c;
  double temperature_s;
  bool all_on;  ///< none of the protections above is switched off
};

constexpr SecondLine second_line(std::span<const hal::bq76952::Setting> settings, double shunt_mohm) {
  using namespace hal::bq76952;
  const auto cell_v = [&](std::uint16_t at) { return cell_step_v * value_of(settings, at); };
  const auto shunt_a = [&](std::uint16_t at) { return shunt_step_mv * value_of(settings, at) / shunt_mohm; };
  const auto celsius = [&](std::uint16_t at) { return static_cast<std::int8_t>(value_of(settings, at)); };
  const double user_a = value_of(settings, 0x9303) == 0x06 ? 0.01 : 0.1;
  const auto is = [&](std::uint16_t at, std::uint32_t bits) { return (value_of(settings, at) & bits) == bits; };
  const auto delay_s = [&](std::uint16_t at) { return 0.0033 * (value_of(settings, at) + 2); };
  return {.overvoltage_v = cell_v(0x9278),
          .overvoltage_s = delay_s(0x9279),
          .undervoltage_v = cell_v(0x9275),
          .undervoltage_s = delay_s(0x9276),
          .charge_overcurrent_a = shunt_a(0x9280),
          .charge_overcurrent_s = delay_s(0x9281),
          .overcurrent_a = shunt_a(0x9282),
          .overcurrent_s = delay_s(0x9283),
          .high_overcurrent_a = shunt_a(0x9284),
          .high_overcurrent_s = delay_s(0x9285),
          .short_circuit_a = short_circuit_mv[value_of(settings, 0x9286)] / shunt_mohm,
          .host_silence_s = 1.0 * value_of(settings, 0x92B2),
          .sustained_a = user_a * (0x10000 - value_of(settings, 0x928A)),
          .sustained_s = 1.0 * value_of(settings, 0x928C),
          .charge_hot_c = celsius(0x929A),
          .discharge_hot_c = celsius(0x929D),
          .charge_cold_c = celsius(0x92A6),
          .temperature_s =
              1.0 * std::min({value_of(settings, 0x929B), value_of(settings, 0x929E), value_of(settings, 0x92A7)}),
          .all_on = is(0x9261, 0xFC) && is(0x9262, 0x31) && is(0x9263, 0xC2) && is(0x9265, 0x98) && is(0x9266, 0x11) &&
                    is(0x9267, 0x42) && is(0x9269, 0xE4) && is(0x926A, 0x20) && is(0x926B, 0xC2)};
}

// Each pair of a protection of the chip and a row: the chip's threshold is wider, and its delay is longer than that of
// the row and the time that a sample needs.

constexpr bool overvoltage_is_wider_and_slower(const SecondLine& chip, const protection::Rules& rules,
                                               double sample_period_s) {
  const protection::Rule& row = rule_of(rules, protection::Fault::cell_overvoltage_severe);
  return chip.overvoltage_v >= 1e-6 * row.threshold + voltage_margin_v - 1e-9 &&
         chip.overvoltage_s >= 1e-6 * row.delay_us + 3 * sample_period_s;
}
constexpr bool undervoltage_is_wider_and_slower(const SecondLine& chip, const protection::Rules& rules,
                                                double sample_period_s) {
  const protection::Rule& row = rule_of(rules, protection::Fault::cell_undervoltage_severe);
  return chip.undervoltage_v <= 1e-6 * row.threshold - voltage_margin_v + 1e-9 &&
         chip.undervoltage_s >= 1e-6 * row.delay_us + 3 * sample_period_s;
}
/// A comparator that ends below the row must still leave every current to the first line that a truck may have.
constexpr bool overcurrent_is_wider_and_slower(const SecondLine& chip, const protection::Rules& rules,
                                               const protection::PackDesign& pack) {
  const protection::Rule& row = rule_of(rules, protection::Fault::short_circuit);
  const double row_a = 1e-6 * row.threshold, row_s = 1e-6 * row.delay_us;
  const auto slower = [&](double a, double s) {
    return a > row_a && s >= row_s + first_line_s(a / row_a, pack.sample_period_s);
  };
  return (slower(chip.charge_overcurrent_a, chip.charge_overcurrent_s) ||
          (chip.charge_overcurrent_a >= least_charge_ratio * pack.limits.charge_current_max_a &&
           chip.charge_overcurrent_s >= first_line_s(1, pack.sample_period_s))) &&
         slower(chip.overcurrent_a, chip.overcurrent_s) && slower(chip.high_overcurrent_a, chip.high_overcurrent_s) &&
         chip.short_circuit_a > row_a;
}
/// A charge pulse that the cell file rates is carried, with the error of the sensor, or is a short circuit for the
/// first line, too.
constexpr bool charge_overcurrent_is_above_rated_pulses(const SecondLine& chip, const protection::Rules& rules,
                                                        const protection::PackDesign& pack) {
  const double rated_a = std::max(pack.pulses.charge.for_10s_a, pack.pulses.charge.for_30s_a);
  return chip.charge_overcurrent_a > 1e-6 * rule_of(rules, protection::Fault::short_circuit).threshold ||
         chip.charge_overcurrent_a >= protection::overcurrent_from * rated_a;
}
constexpr bool sustained_is_wider_and_slower(const SecondLine& chip, const protection::PackDesign& pack) {
  return chip.sustained_s >= overload_opens_s(pack, chip.sustained_a);
}
constexpr bool temperatures_are_wider_and_slower(const SecondLine& chip, const protection::Rules& rules) {
  using enum protection::Fault;
  const auto slower = [&](protection::Fault fault) {
    return chip.temperature_s >= 1e-6 * rule_of(rules, fault).delay_us + grace_s + chain_s;
  };
  const auto celsius = [&](protection::Fault fault) { return 0.01 * rule_of(rules, fault).threshold; };
  return chip.charge_hot_c >= celsius(charge_overtemperature) + 3 && slower(charge_overtemperature) &&
         chip.discharge_hot_c >= celsius(overtemperature) + 3 && slower(overtemperature) &&
         chip.charge_cold_c <= celsius(charge_undertemperature) - 3 && slower(charge_undertemperature);
}
/// SHUTDOWN of a hot chip opens main plus under load. The firmware has opened before, even if the die warms up by 2
/// K/s.
constexpr bool die_opens_before_shutdown(std::span<const hal::bq76952::Setting> settings,
                                         const protection::Rules& rules) {
  constexpr double rise_k_per_s = 2;
  const protection::Rule& row = rule_of(rules, protection::Fault::front_end_hot);
  return 0.01 * row.threshold + rise_k_per_s * (1e-6 * row.delay_us + grace_s + chain_s) <=
         static_cast<std::int8_t>(hal::bq76952::value_of(settings, 0x9244));
}
constexpr bool host_silence_is_slower(const SecondLine& chip, const protection::Rules& rules) {
  return chip.host_silence_s > 1e-6 * rule_of(rules, protection::Fault::samples_missing).threshold;
}
/// The row short circuit lies within the range of the current reading.
constexpr bool current_is_in_range(const hal::bq76952::Board& board, const protection::Rules& rules) {
  return hal::bq76952::current_end_a(board) >=
         range_ratio * 1e-6 * rule_of(rules, protection::Fault::short_circuit).threshold;
}

}  // namespace bms::firmware
