// Thresholds and delays of the measuring chip's own protections, the second line, from those of the first line: the
// rows of protection's table. The second line is wider and slower, so that warning, derating and grace time come first.
// Only its comparator for short circuits is faster.
//
//   chip                  threshold                                  delay
//   cell overvoltage      20 mV above cell overvoltage severe        0.8 s more than that row
//   cell undervoltage     20 mV below deep discharge, so that a       the same
//                         recovery charge is possible above it
//   overcurrent           1.2 times short circuit                    0.42 s, both directions
//   high overcurrent      1.5 times short circuit                    0.35 s, discharge
//   short circuit         2 times short circuit, at least the         0.45 ms, discharge
//                         current that main plus makes
//
// The first line needs at most first_line_s for the row short circuit: two means of 100.5 ms, as its filter is not
// synchronous to the current, a sample period and the processing of a sample.
#pragma once

#include <algorithm>

#include "hal/bq76952/configuration.hpp"
#include "protection/table.hpp"

namespace bms::firmware {

inline constexpr double voltage_margin_v = 0.02, slower_by_s = 0.8;
inline constexpr double overcurrent_ratio = 1.2, high_overcurrent_ratio = 1.5, short_circuit_ratio = 2;
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

/// Board around the chip for this pack. rules: those of its table.
constexpr hal::bq76952::Board front_end_board(const protection::PackDesign& pack, const protection::Rules& rules) {
  using enum protection::Fault;
  const protection::Rule &high = rule_of(rules, cell_overvoltage_severe),
                         &low = rule_of(rules, cell_undervoltage_severe);
  const double short_a = 1e-6 * rule_of(rules, short_circuit).threshold;
  return {.current_range_a = std::max(327.0, range_ratio * short_a),
          .cell_inputs = hal::bq76952::inputs_of_pack(pack.cells),
          .overvoltage_v = 1e-6 * high.threshold + voltage_margin_v,
          .undervoltage_v = 1e-6 * rule_of(rules, deep_discharge).threshold - voltage_margin_v,
          .voltage_delay_s = 1e-6 * std::max(high.delay_us, low.delay_us) + slower_by_s,
          .overcurrent_a = overcurrent_ratio * short_a,
          .overcurrent_delay_s = overcurrent_delay_s,
          .high_overcurrent_a = high_overcurrent_ratio * short_a,
          .high_overcurrent_delay_s = high_overcurrent_delay_s,
          .short_circuit_a = std::max(short_circuit_ratio * short_a, pack.closing_current_max_a)};
}

/// What the chip will do, as its settings say: thresholds and delays in SI units. A protection that is off never trips.
struct SecondLine {
  double overvoltage_v, overvoltage_s, undervoltage_v, undervoltage_s;
  double charge_overcurrent_a, charge_overcurrent_s, overcurrent_a, overcurrent_s, high_overcurrent_a,
      high_overcurrent_s, short_circuit_a, host_silence_s;
};

constexpr SecondLine second_line(std::span<const hal::bq76952::Setting> settings, double shunt_mohm) {
  using namespace hal::bq76952;
  const auto cell_v = [&](std::uint16_t at) { return cell_step_v * value_of(settings, at); };
  const auto shunt_a = [&](std::uint16_t at, std::uint32_t enabled) {
    constexpr double never_a = 1e9;
    return (value_of(settings, 0x9261) & enabled) != 0 ? shunt_step_mv * value_of(settings, at) / shunt_mohm : never_a;
  };
  const auto delay_s = [&](std::uint16_t at) { return 0.0033 * (value_of(settings, at) + 2); };
  return {.overvoltage_v = cell_v(0x9278),
          .overvoltage_s = delay_s(0x9279),
          .undervoltage_v = cell_v(0x9275),
          .undervoltage_s = delay_s(0x9276),
          .charge_overcurrent_a = shunt_a(0x9280, 0x10),
          .charge_overcurrent_s = delay_s(0x9281),
          .overcurrent_a = shunt_a(0x9282, 0x20),
          .overcurrent_s = delay_s(0x9283),
          .high_overcurrent_a = shunt_a(0x9284, 0x40),
          .high_overcurrent_s = delay_s(0x9285),
          .short_circuit_a = short_circuit_mv[value_of(settings, 0x9286)] / shunt_mohm,
          .host_silence_s = 1.0 * value_of(settings, 0x92B2)};
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
constexpr bool overcurrent_is_wider_and_slower(const SecondLine& chip, const protection::Rules& rules,
                                               double sample_period_s) {
  const protection::Rule& row = rule_of(rules, protection::Fault::short_circuit);
  const double row_a = 1e-6 * row.threshold, row_s = 1e-6 * row.delay_us;
  const auto slower = [&](double a, double s) {
    return a > row_a && s >= row_s + first_line_s(a / row_a, sample_period_s);
  };
  return slower(chip.charge_overcurrent_a, chip.charge_overcurrent_s) &&
         slower(chip.overcurrent_a, chip.overcurrent_s) && slower(chip.high_overcurrent_a, chip.high_overcurrent_s) &&
         chip.short_circuit_a > row_a;
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
