// All protections of a pack as one table: data, computed from the limits of its cells.
//
//   raised     when the quantity has been beyond the threshold for the delay (fault_monitor.hpp: effect of noise)
//   released   when the quantity has been at the release threshold or better for the recovery time, and then as the
//              recovery demands: automatic, by a clear command, or by service
//
// Voltages are the limits of the cell and fractions of its span (highest minus lowest limit): 1.65 V for LFP, so 1 % is
// 16.5 mV. Currents are multiples of the continuous limit. README.md shows the same table with the values of one pack,
// generated from this.
//
// Sources: limits of voltage and current, Table 2 of Energies 14 (2021) 6221. No charging of a graphite cell below 0
// degrees C, because lithium plates (Petzl, Kasper, Danzer, J. Power Sources 275 (2015) 799, on LFP). In a cell that is
// discharged too deeply, the copper of the negative collector dissolves and later shorts the cell (Guo et al.,
// Scientific Reports 6 (2016) 30248).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "protection/faults.hpp"
#include "protection/overload.hpp"
#include "protection/pack_design.hpp"
#include "protection/rule.hpp"

namespace bms::protection {

/// One protection as it is written in the table. Thresholds are in the unit of the quantity.
struct Protected {
  Fault fault;
  struct {
    Quantity quantity;
    Sense sense;
    std::int32_t threshold;
    double delay_s;
  } raised;
  struct {
    std::int32_t threshold;
    double after_s;
    Recovery recovery;
  } released;
  Reaction reaction;
  const char* why;  ///< reason for the delay
};

/// A rule with the reason for its delay. Firmware that does not use the reasons does not contain them.
struct Row {
  Rule rule;
  const char* why;
};

constexpr Row row(const Protected& p) {
  return {.rule = {.threshold = p.raised.threshold,
                   .release = p.released.threshold,
                   .delay_us = in_us(p.raised.delay_s),
                   .recover_us = in_us(p.released.after_s),
                   .fault = p.fault,
                   .quantity = p.raised.quantity,
                   .sense = p.raised.sense,
                   .recovery = p.released.recovery,
                   .reaction = p.reaction},
          .why = p.why};
}

using Table = std::array<Row, known_faults>;  ///< the first fault_count act
using Rules = std::array<Rule, fault_count>;

constexpr Table protection_table(const PackDesign& d) {
  using enum Fault;
  using enum Quantity;
  using enum Sense;
  using enum Recovery;
  using enum Reaction;
  const model::Limits& l = d.limits;
  const double span_v = l.voltage_max_v - l.voltage_min_v, cells = d.cells;
  const double sum_error_v = cells * d.cell_error_v + d.pack_error_v;
  const double most_a = std::max(l.charge_current_max_a, l.discharge_current_max_a);
  const auto high_v = [&](double of_span) { return in_micro(l.voltage_max_v + of_span * span_v); };
  const auto low_v = [&](double of_span) { return in_micro(l.voltage_min_v + of_span * span_v); };
  const auto pack_high_v = [&](double of_span) { return in_micro(cells * (l.voltage_max_v + of_span * span_v)); };
  const auto pack_low_v = [&](double of_span) { return in_micro(cells * (l.voltage_min_v + of_span * span_v)); };
  const auto span = [&](double of_span) { return in_micro(of_span * span_v); };
  const auto hot_c = [&](double above_max) { return in_centi(l.temperature_max_c + above_max); };
  const auto cold_c = [&](double above_min) { return in_centi(l.temperature_min_c + above_min); };
  const double freezing_c = std::max(l.temperature_min_c, 0.0);
  return {{
      row({.fault = cell_overvoltage_warning,
           .raised = {.quantity = highest_cell_uv, .sense = above, .threshold = high_v(0), .delay_s = 1},
           .released = {.threshold = high_v(-0.03), .after_s = 5, .recovery = automatic},
           .reaction = derate,
           .why = "the ringing of an inverter's current step is shorter"}),
      row({.fault = cell_overvoltage,
           .raised = {.quantity = highest_cell_uv, .sense = above, .threshold = high_v(0.03), .delay_s = 2},
           .released = {.threshold = high_v(-0.06), .after_s = 60, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "a charger needs one to two seconds to obey a limit of 0 A; in a minute the cell relaxes"}),
      row({.fault = cell_overvoltage_severe,
           .raised = {.quantity = highest_cell_uv, .sense = above, .threshold = high_v(0.1), .delay_s = 0.2},
           .released = {.threshold = high_v(-0.06), .after_s = 10, .recovery = on_clear},
           .reaction = open_now,
           .why = "two samples at 10 Hz, so that a single wrong reading does not open under load"}),
      row({.fault = cell_undervoltage_warning,
           .raised = {.quantity = lowest_cell_uv, .sense = below, .threshold = low_v(0.3), .delay_s = 5},
           .released = {.threshold = low_v(0.36), .after_s = 5, .recovery = automatic},
           .reaction = derate,
           .why = "lifting a load takes seconds and causes such a dip when the cells are cold"}),
      row({.fault = cell_undervoltage,
           .raised = {.quantity = lowest_cell_uv, .sense = below, .threshold = low_v(0), .delay_s = 2},
           .released = {.threshold = low_v(0.55), .after_s = 60, .recovery = automatic},
           .reaction = forbid_discharge,
           .why = "a truck reduces its current within one second; released above the rest voltage of an empty cell"}),
      row({.fault = cell_undervoltage_severe,
           .raised = {.quantity = lowest_cell_uv, .sense = below, .threshold = low_v(-0.12), .delay_s = 0.2},
           .released = {.threshold = low_v(0), .after_s = 10, .recovery = on_clear},
           .reaction = open_now,
           .why =
               "two samples at 10 Hz; released at the limit, up to which a pack is charged with a recovery current"}),
      row({.fault = pack_overvoltage,
           .raised = {.quantity = pack_uv, .sense = above, .threshold = pack_high_v(0.02), .delay_s = 2},
           .released = {.threshold = pack_high_v(-0.06), .after_s = 60, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "as for a cell, by a second measurement"}),
      row({.fault = pack_undervoltage,
           .raised = {.quantity = pack_uv, .sense = below, .threshold = pack_low_v(0.06), .delay_s = 2},
           .released = {.threshold = pack_low_v(0.55), .after_s = 60, .recovery = automatic},
           .reaction = forbid_discharge,
           .why = "as for a cell, by a second measurement"}),
      row({.fault = charge_overcurrent,
           .raised = {.quantity = charge_overload_i2t_us, .sense = above, .threshold = full_overload_us, .delay_s = 0},
           .released = {.threshold = full_overload_us / 2, .after_s = 30, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "the integral is the delay: 11 s at twice the limit, 29 s at 1.5 times the limit"}),
      row({.fault = discharge_overcurrent,
           .raised =
               {.quantity = discharge_overload_i2t_us, .sense = above, .threshold = full_overload_us, .delay_s = 0},
           .released = {.threshold = full_overload_us / 2, .after_s = 30, .recovery = automatic},
           .reaction = forbid_discharge,
           .why = "as for the charge current"}),
      row({.fault = short_circuit,
           .raised = {.quantity = current_magnitude_ua,
                      .sense = above,
                      .threshold = in_micro(short_circuit_a(d)),
                      .delay_s = 0},
           .released = {.threshold = in_micro(most_a), .after_s = 10, .recovery = service},
           .reaction = open_now,
           .why = "no delay: fuse and comparator are faster, this fault keeps the contactors open"}),
      row({.fault = overtemperature_warning,
           .raised = {.quantity = highest_cdegc, .sense = above, .threshold = hot_c(-5), .delay_s = 5},
           .released = {.threshold = hot_c(-8), .after_s = 30, .recovery = automatic},
           .reaction = derate,
           .why = "a cell warms up in minutes, a thermistor follows in 10 s"}),
      row({.fault = overtemperature,
           .raised = {.quantity = highest_cdegc, .sense = above, .threshold = hot_c(0), .delay_s = 5},
           .released = {.threshold = hot_c(-10), .after_s = 60, .recovery = automatic},
           .reaction = open,
           .why = "as for the warning"}),
      row({.fault = charge_overtemperature,
           .raised = {.quantity = highest_cdegc, .sense = above, .threshold = hot_c(-15), .delay_s = 5},
           .released = {.threshold = hot_c(-18), .after_s = 60, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "as for the warning"}),
      row({.fault = undertemperature,
           .raised = {.quantity = lowest_cdegc, .sense = below, .threshold = cold_c(0), .delay_s = 5},
           .released = {.threshold = cold_c(3), .after_s = 60, .recovery = automatic},
           .reaction = forbid_discharge,
           .why = "as for the warning"}),
      row({.fault = charge_undertemperature,
           .raised = {.quantity = lowest_cdegc, .sense = below, .threshold = in_centi(freezing_c), .delay_s = 5},
           .released = {.threshold = in_centi(freezing_c + 2), .after_s = 60, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "as for the warning"}),
      row({.fault = open_wire,
           .raised = {.quantity = opposite_shift_uv, .sense = above, .threshold = span(0.15), .delay_s = 0.5},
           .released = {.threshold = span(0.06), .after_s = 10, .recovery = on_clear},
           .reaction = open,
           .why = "relay bounce and noise bursts last 100 ms"}),
      row({.fault = imbalance,
           .raised = {.quantity = spread_uv, .sense = above, .threshold = span(0.2), .delay_s = 30},
           .released = {.threshold = span(0.12), .after_s = 60, .recovery = automatic},
           .reaction = warn,
           .why = "near a knee of the OCV the cell voltages differ as long as a load lasts"}),
      row({.fault = current_implausible,
           .raised = {.quantity = estimator_contradiction, .sense = above, .threshold = 0, .delay_s = 60},
           .released = {.threshold = 0, .after_s = 60, .recovery = automatic},
           .reaction = derate,
           .why = "model errors have a correlation time of about a minute"}),
      row({.fault = sum_mismatch,
           .raised = {.quantity = sum_error_uv,
                      .sense = above,
                      .threshold = in_micro(std::min(sum_error_v + cells * d.cell_skew_v, 0.03 * cells * span_v)),
                      .delay_s = 1},
           .released = {.threshold = in_micro(std::min(sum_error_v, 0.015 * cells * span_v)),
                        .after_s = 10,
                        .recovery = on_clear},
           .reaction = open,
           .why = "cells and pack are not sampled at the same moment of a current step"}),
      row({.fault = voltage_missing,
           .raised = {.quantity = voltages_missing, .sense = above, .threshold = 0, .delay_s = 0.5},
           .released = {.threshold = 0, .after_s = 5, .recovery = automatic},
           .reaction = open,
           .why = "in this time the monitoring chip is read again and woken"}),
      row({.fault = voltage_stuck,
           .raised = {.quantity = voltages_stuck, .sense = above, .threshold = 0, .delay_s = 1},
           .released = {.threshold = 0, .after_s = 10, .recovery = on_clear},
           .reaction = open,
           .why = "five equal samples have come before"}),
      row({.fault = current_missing,
           .raised = {.quantity = currents_missing, .sense = above, .threshold = 0, .delay_s = 0.5},
           .released = {.threshold = 0, .after_s = 5, .recovery = automatic},
           .reaction = open,
           .why = "in this time the sensor is read again"}),
      row({.fault = temperature_lost,
           .raised = {.quantity = temperatures_missing, .sense = above, .threshold = 0, .delay_s = 2},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = derate,
           .why = "temperatures change slowly, and a plug may be loose for a moment"}),
      row({.fault = temperature_stuck,
           .raised = {.quantity = temperatures_stuck, .sense = above, .threshold = 0, .delay_s = 10},
           .released = {.threshold = 0, .after_s = 60, .recovery = automatic},
           .reaction = derate,
           .why = "temperatures change slowly"}),
      row({.fault = deep_discharge,
           .raised = {.quantity = lowest_cell_uv,
                      .sense = below,
                      .threshold = in_micro(0.75 * l.voltage_min_v),
                      .delay_s = 10},
           .released = {.threshold = in_micro(0.8 * l.voltage_min_v), .after_s = 0, .recovery = service},
           .reaction = open,
           .why = "no load that the faults above allow lasts as long"}),
      row({.fault = precharge_failed,
           .raised = {.quantity = precharge_off_curve, .sense = above, .threshold = 0, .delay_s = 0},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = open_now,
           .why = "no delay: the time is in the curve; the resistor cools for ten seconds before the next attempt"}),
      row({.fault = contactor_welded,
           .raised = {.quantity = welded, .sense = above, .threshold = 0, .delay_s = 0.2},
           .released = {.threshold = 0, .after_s = 10, .recovery = service},
           .reaction = open_now,
           .why = "two samples at 10 Hz"}),
      row({.fault = contactor_not_closed,
           .raised = {.quantity = not_closed, .sense = above, .threshold = 0, .delay_s = 0.3},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = open_now,
           .why = "a contactor closes and stops bouncing within 50 ms"}),
      row({.fault = samples_missing,
           .raised =
               {.quantity = sample_age_us, .sense = above, .threshold = in_micro(5 * d.sample_period_s), .delay_s = 0},
           .released = {.threshold = in_micro(2 * d.sample_period_s), .after_s = 1, .recovery = automatic},
           .reaction = open_now,
           .why = "no delay: the threshold is five sample periods; before the first sample it is the start time of the "
                  "measuring chain"}),
      row({.fault = internal_fault,
           .raised = {.quantity = integrity_error, .sense = above, .threshold = 0, .delay_s = 0},
           .released = {.threshold = 0, .after_s = 0, .recovery = on_clear},
           .reaction = open_now,
           .why = "no delay: an untrusted state must not drive outputs"}),
      row({.fault = storage_fault,
           .raised = {.quantity = storage_failed, .sense = above, .threshold = 0, .delay_s = 0},
           .released = {.threshold = 0, .after_s = 0, .recovery = on_clear},
           .reaction = warn,
           .why = "no delay: the storage has already tried again"}),
      row({.fault = second_line_tripped,
           .raised = {.quantity = second_line_trips, .sense = above, .threshold = 0, .delay_s = 0},
           .released = {.threshold = 0, .after_s = 10, .recovery = on_clear},
           .reaction = open_now,
           .why = "no delay: the front end has waited, and has already opened"}),
      row({.fault = second_line_failed,
           .raised = {.quantity = second_line_broken, .sense = above, .threshold = 0, .delay_s = 0.2},
           .released = {.threshold = 0, .after_s = 10, .recovery = service},
           .reaction = open_now,
           .why = "two samples at 10 Hz, so that a single wrong reading does not need service"}),
      row({.fault = current_sensors_differ,
           .raised = {.quantity = current_difference_ua,
                      .sense = above,
                      .threshold = in_micro(d.second_current_offset_a),
                      .delay_s = 2},
           .released = {.threshold = in_micro(0.5 * d.second_current_offset_a), .after_s = 10, .recovery = on_clear},
           .reaction = open,
           .why = "the sensors do not average over the same time; a lift changes the current for a second"}),
      row({.fault = temperature_unknown,
           .raised = {.quantity = temperatures_unknown, .sense = above, .threshold = 0, .delay_s = 60},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = open,
           .why = "at 5C a cell warms up by less than 10 K in a minute, and currents are a quarter by then"}),
      row({.fault = current_unrequested,
           .raised = {.quantity = flows_unrequested, .sense = above, .threshold = 0, .delay_s = 60},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = open,
           .why = "a lifted load can be lowered within a minute"}),
      row({.fault = allowed_current_exceeded,
           .raised = {.quantity = exceeds_allowed, .sense = above, .threshold = 0, .delay_s = 10},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = warn,
           .why = "a truck reduces its current within one second; lifting a load takes seconds"}),
      row({.fault = charge_limit_exceeded,
           .raised = {.quantity = charge_excess_us, .sense = above, .threshold = in_micro(3.6), .delay_s = 0},
           .released = {.threshold = in_micro(1.8), .after_s = 10, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "the integral is the delay: 0.1 % of the capacity; a truck that obeys within a second uses a third"}),
      row({.fault = discharge_limit_exceeded,
           .raised = {.quantity = discharge_excess_us, .sense = above, .threshold = in_micro(3.6), .delay_s = 0},
           .released = {.threshold = in_micro(1.8), .after_s = 10, .recovery = automatic},
           .reaction = forbid_discharge,
           .why = "as for the charge limit"}),
      row({.fault = limit_not_obeyed,
           .raised = {.quantity = largest_excess_us, .sense = above, .threshold = in_micro(10.8), .delay_s = 0},
           .released = {.threshold = in_micro(10.2), .after_s = 10, .recovery = automatic},
           .reaction = open_now,
           .why =
               "the integral is the delay: 0.3 % of the capacity, of which 0.2 % after the allowed current was 0; "
               "released after two minutes at most, as the next charge above the allowed current opens again at once"}),
      row({.fault = supply_dip,
           .raised = {.quantity = supply_dips, .sense = above, .threshold = 0, .delay_s = 0},
           .released = {.threshold = 0, .after_s = 1, .recovery = automatic},
           .reaction = open_now,
           .why = "no delay: the interrupt has already opened"}),
      row({.fault = thermistor_shorted,
           .raised = {.quantity = temperatures_shorted, .sense = above, .threshold = 0, .delay_s = 10},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = open,
           .why = "before the front end, which takes it for a hot cell and opens main plus after 20 s, under load"}),
      row({.fault = second_current_missing,
           .raised = {.quantity = second_currents_missing, .sense = above, .threshold = 0, .delay_s = 5},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = derate,
           .why = "after a start the sensor learns its value at no current for 0.8 s"}),
      row({.fault = interlock_open,
           .raised = {.quantity = loop_open, .sense = above, .threshold = 0, .delay_s = 0.2},
           .released = {.threshold = 0, .after_s = 5, .recovery = automatic},
           .reaction = open_now,
           .why = "two samples at 10 Hz: a loop that vibrates; its contacts part before those of the power"}),
      row({.fault = crash,
           .raised = {.quantity = crashed, .sense = above, .threshold = 0, .delay_s = 0},
           .released = {.threshold = 0, .after_s = 10, .recovery = service},
           .reaction = open_now,
           .why = "no delay: the sensor has decided"}),
      row({.fault = insulation_low,
           .raised = {.quantity = insulation_ohm, .sense = below, .threshold = least_insulation_ohm(d), .delay_s = 10},
           .released = {.threshold = least_insulation_ohm(d) / 4 * 5, .after_s = 60, .recovery = automatic},
           .reaction = forbid_charge,
           .why = "the monitor has averaged; a first fault does not stop a truck, but the charger is earthed"}),
      row({.fault = insulation_unknown,
           .raised = {.quantity = insulation_missing, .sense = above, .threshold = 0, .delay_s = 60},
           .released = {.threshold = 0, .after_s = 10, .recovery = automatic},
           .reaction = warn,
           .why = "a monitor needs up to 20 s for its first value"}),
      row({.fault = front_end_hot,
           .raised = {.quantity = Quantity::front_end_cdegc, .sense = above, .threshold = in_centi(95), .delay_s = 2},
           .released = {.threshold = in_centi(85), .after_s = 60, .recovery = automatic},
           .reaction = open,
           .why = "a die warms up in minutes; at 110 °C the measuring chip shuts down and opens main plus under load"}),
      row({.fault = group_incomplete,
           .raised = {.quantity = batteries_missing, .sense = above, .threshold = 0, .delay_s = 1},
           .released = {.threshold = 0, .after_s = 5, .recovery = automatic},
           .reaction = warn,
           .why = "three lost messages count as missing; the battery without a leader opens after the same time"}),
  }};
}

/// The table without its reasons, for the firmware.
constexpr Rules rules_of(const Table& table) {
  Rules rules{};
  for (std::size_t k = 0; k < fault_count; ++k) rules[k] = table[k].rule;
  return rules;
}

/// One bit for each fault with this reaction.
constexpr FaultSet faults_with(const Rules& rules, Reaction reaction) {
  FaultSet all = 0;
  for (const Rule& r : rules) all |= r.reaction == reaction ? bit(r.fault) : 0;
  return all;
}
/// One bit for each fault with this recovery.
constexpr FaultSet faults_with(const Rules& rules, Recovery recovery) {
  FaultSet all = 0;
  for (const Rule& r : rules) all |= r.recovery == recovery ? bit(r.fault) : 0;
  return all;
}

/// Returns true if row k belongs to bit k and no release is on the wrong side of its threshold.
constexpr bool consistent(const Rules& rules) {
  for (std::size_t k = 0; k < fault_count; ++k) {
    const Rule& r = rules[k];
    if (static_cast<std::size_t>(r.fault) != k) return false;
    if (r.sense == Sense::above ? r.release > r.threshold : r.release < r.threshold) return false;
  }
  return true;
}

}  // namespace bms::protection
