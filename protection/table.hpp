// All protections of a pack as one table: data, derived from the limits of its cells.
//
//   a fault comes   when its quantity is beyond the threshold for so long (delay; fault_monitor.hpp says what noise
//   does to that) a fault goes    when its quantity is back at the release threshold or better for so long, in the way
//   that its recovery says
//
// Voltages are limits of the cell and fractions of its span (highest less lowest limit): 1.65 V for LFP, so 1 % is 16.5
// mV. Currents are multiples of the continuous limit. The same table in words and with the figures of one pack:
// README.md, made from this.
//
// Sources: limits of voltage and current, Table 2 of Energies 14 (2021) 6221. No charging of a graphite cell below 0
// degrees C: lithium plates (Petzl, Kasper, Danzer, J. Power Sources 275 (2015) 799, on LFP). Copper of the negative
// collector dissolves in a cell that is discharged too deep and later shorts it (Guo et al., Scientific Reports 6
// (2016) 30248).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "protection/faults.hpp"
#include "protection/pack_design.hpp"

namespace bms::protection {

/// What is compared, in integers; quantities.hpp says how each comes about.
enum class Quantity : std::uint8_t {
  highest_cell_uv,
  lowest_cell_uv,
  pack_uv,
  charge_overload_i2t_us,  ///< integral of (I / limit)^2 - 1 over time, not below 0, while charging
  discharge_overload_i2t_us,
  current_magnitude_ua,
  highest_cdegc,
  lowest_cdegc,
  opposite_shift_uv,        ///< of two neighbours from the mean: by how much both, in opposite ways
  spread_uv,                ///< highest less lowest cell
  estimator_contradiction,  ///< the estimator disbelieves what it reads: 0 or 1
  sum_error_uv,             ///< sum of cells less pack, magnitude
  voltages_missing,         ///< how many readings
  voltages_stuck,
  currents_missing,  ///< 0 or 1
  temperatures_missing,
  temperatures_stuck,
  precharge_off_curve,  ///< 0 or 1, these three from the contactors
  welded,
  not_closed,
  sample_age_us,    ///< since the last sample that could be used
  integrity_error,  ///< 0 or 1
  storage_failed,   ///< 0 or 1
};
inline constexpr std::size_t quantity_count = 23;

enum class Sense : std::uint8_t { above, below };

struct Rule {
  std::int32_t threshold, release;
  std::uint32_t delay_us, recover_us;
  Fault fault;
  Quantity quantity;
  Sense sense;
  Recovery recovery;
  Reaction reaction;
};

/// A rule with the reason for its delay; the words stay out of firmware that does not ask for them.
struct Row {
  Rule rule;
  const char* why;
};

using Table = std::array<Row, fault_count>;
using Rules = std::array<Rule, fault_count>;

/// Permanent current above the limit that counts as such: what a sensor of 1 % and a controller may be off.
inline constexpr double overcurrent_from = 1.05;

constexpr Table protection_table(const PackDesign& d) {
  using enum Fault;
  using enum Quantity;
  using enum Sense;
  using enum Recovery;
  using enum Reaction;
  const model::Limits& l = d.limits;
  const double span_v = l.voltage_max_v - l.voltage_min_v, cells = d.cells;
  const double most_a = std::max(l.charge_current_max_a, l.discharge_current_max_a);
  const auto high_v = [&](double of_span) { return in_micro(l.voltage_max_v + of_span * span_v); };
  const auto low_v = [&](double of_span) { return in_micro(l.voltage_min_v + of_span * span_v); };
  const auto pack_high_v = [&](double of_span) { return in_micro(cells * (l.voltage_max_v + of_span * span_v)); };
  const auto pack_low_v = [&](double of_span) { return in_micro(cells * (l.voltage_min_v + of_span * span_v)); };
  const auto span = [&](double of_span) { return in_micro(of_span * span_v); };
  const double freezing_c = std::max(l.temperature_min_c, 0.0);
  const auto row = [](Fault f, Quantity q, Sense s, std::int32_t threshold, double delay_s, std::int32_t release,
                      double recover_s, Recovery recovery, Reaction reaction, const char* why) {
    return Row{{threshold, release, in_us(delay_s), in_us(recover_s), f, q, s, recovery, reaction}, why};
  };
  return {{
      row(cell_overvoltage_warning, highest_cell_uv, above, high_v(0), 1, high_v(-0.03), 5, automatic, derate,
          "an inverter's current step rings for less"),
      row(cell_overvoltage, highest_cell_uv, above, high_v(0.03), 2, high_v(-0.06), 60, automatic, forbid_charge,
          "a charger that is told 0 A needs a second or two; a minute lets the cell relax"),
      row(cell_overvoltage_severe, highest_cell_uv, above, high_v(0.1), 0.2, high_v(-0.06), 10, on_clear, open_now,
          "two samples at 10 Hz, so that one bad reading opens nothing under load"),
      row(cell_undervoltage_warning, lowest_cell_uv, below, low_v(0.3), 5, low_v(0.36), 5, automatic, derate,
          "lifting a load takes seconds and dips that deep when cold"),
      row(cell_undervoltage, lowest_cell_uv, below, low_v(0), 2, low_v(0.55), 60, automatic, forbid_discharge,
          "a truck ramps down within one; released above where an empty cell comes to rest"),
      row(cell_undervoltage_severe, lowest_cell_uv, below, low_v(-0.12), 0.2, low_v(0), 10, on_clear, open_now,
          "two samples at 10 Hz; released at the limit, so that an empty pack can be charged"),
      row(pack_overvoltage, pack_uv, above, pack_high_v(0.02), 2, pack_high_v(-0.06), 60, automatic, forbid_charge,
          "as a cell's; by a second measurement"),
      row(pack_undervoltage, pack_uv, below, pack_low_v(0.06), 2, pack_low_v(0.55), 60, automatic, forbid_discharge,
          "as a cell's; by a second measurement"),
      row(charge_overcurrent, charge_overload_i2t_us, above, 30'000'000, 0, 15'000'000, 30, automatic, forbid_charge,
          "the integral is the delay: twice the limit for 10 s, half as much again for 24 s"),
      row(discharge_overcurrent, discharge_overload_i2t_us, above, 30'000'000, 0, 15'000'000, 30, automatic,
          forbid_discharge, "the same"),
      row(short_circuit, current_magnitude_ua, above, in_micro(5 * most_a), 0, in_micro(most_a), 10, service, open_now,
          "none: one sample; fuse and comparator are faster, this keeps it open"),
      row(overtemperature_warning, highest_cdegc, above, in_centi(l.temperature_max_c - 5), 5,
          in_centi(l.temperature_max_c - 8), 30, automatic, derate, "a cell needs minutes to warm, a thermistor 10 s"),
      row(overtemperature, highest_cdegc, above, in_centi(l.temperature_max_c), 5, in_centi(l.temperature_max_c - 10),
          60, automatic, open, "the same"),
      row(charge_overtemperature, highest_cdegc, above, in_centi(l.temperature_max_c - 15), 5,
          in_centi(l.temperature_max_c - 18), 60, automatic, forbid_charge, "the same"),
      row(undertemperature, lowest_cdegc, below, in_centi(l.temperature_min_c), 5, in_centi(l.temperature_min_c + 3),
          60, automatic, forbid_discharge, "the same"),
      row(charge_undertemperature, lowest_cdegc, below, in_centi(freezing_c), 5, in_centi(freezing_c + 2), 60,
          automatic, forbid_charge, "the same"),
      row(open_wire, opposite_shift_uv, above, span(0.15), 0.5, span(0.06), 10, on_clear, open,
          "a relay's bounce and a burst of noise last 100 ms"),
      row(imbalance, spread_uv, above, span(0.2), 30, span(0.12), 60, automatic, warn,
          "at the knees cells part for as long as a load lasts"),
      row(current_implausible, estimator_contradiction, above, 0, 60, 0, 60, automatic, derate,
          "a model may be wrong for some of its correlation time of a minute"),
      row(sum_mismatch, sum_error_uv, above, static_cast<std::int32_t>(cells) * span(0.03), 1,
          static_cast<std::int32_t>(cells) * span(0.015), 10, on_clear, open,
          "both are not sampled at the same moment of a step"),
      row(voltage_missing, voltages_missing, above, 0, 0.5, 0, 5, automatic, open,
          "a monitoring chip is read again and woken within"),
      row(voltage_stuck, voltages_stuck, above, 0, 1, 0, 10, on_clear, open, "five samples have agreed already"),
      row(current_missing, currents_missing, above, 0, 0.5, 0, 5, automatic, open, "a sensor is asked again within"),
      row(temperature_lost, temperatures_missing, above, 0, 2, 0, 10, automatic, derate,
          "temperatures wait: a plug that is loose for a moment"),
      row(temperature_stuck, temperatures_stuck, above, 0, 10, 0, 60, automatic, derate, "temperatures wait"),
      row(deep_discharge, lowest_cell_uv, below, in_micro(0.75 * l.voltage_min_v), 10, in_micro(0.8 * l.voltage_min_v),
          0, service, open, "no load that the rows above allow lasts that long"),
      row(precharge_failed, precharge_off_curve, above, 0, 0, 0, 10, on_clear, open_now,
          "none: the time is in the curve; the resistor cools for ten seconds before another"),
      row(contactor_welded, welded, above, 0, 0.2, 0, 10, service, open_now, "two samples at 10 Hz"),
      row(contactor_not_closed, not_closed, above, 0, 0.3, 0, 10, on_clear, open_now,
          "a contactor closes and stops bouncing within 50 ms"),
      row(samples_missing, sample_age_us, above, in_micro(5 * d.sample_period_s), 0, in_micro(2 * d.sample_period_s), 1,
          automatic, open_now,
          "none: five sample periods are the threshold; until the first, the measuring chain has its time to start"),
      row(internal_fault, integrity_error, above, 0, 0, 0, 0, on_clear, open_now,
          "none: what cannot be trusted does nothing"),
      row(storage_fault, storage_failed, above, 0, 0, 0, 0, on_clear, warn,
          "none: the store has tried again by itself"),
  }};
}

/// What firmware needs of it.
constexpr Rules rules_of(const Table& table) {
  Rules rules{};
  for (std::size_t k = 0; k < fault_count; ++k) rules[k] = table[k].rule;
  return rules;
}

/// Faults of a table that have this reaction.
constexpr std::uint32_t faults_with(const Rules& rules, Reaction reaction) {
  std::uint32_t all = 0;
  for (const Rule& r : rules) all |= r.reaction == reaction ? bit(r.fault) : 0;
  return all;
}
constexpr std::uint32_t faults_with(const Rules& rules, Recovery recovery) {
  std::uint32_t all = 0;
  for (const Rule& r : rules) all |= r.recovery == recovery ? bit(r.fault) : 0;
  return all;
}

/// Row k is that of bit k, and no release is on the wrong side of its threshold.
constexpr bool consistent(const Rules& rules) {
  for (std::size_t k = 0; k < fault_count; ++k) {
    const Rule& r = rules[k];
    if (static_cast<std::size_t>(r.fault) != k) return false;
    if (r.sense == Sense::above ? r.release > r.threshold : r.release < r.threshold) return false;
  }
  return true;
}

}  // namespace bms::protection
