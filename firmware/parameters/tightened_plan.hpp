// The protections with the limits that a workshop has set: the table of the build, whose thresholds move to the safe
// side. Integers only, because the controller has no doubles.
//
//   voltages      A threshold of the table is a fraction of the span between the two limits of a cell. It is the same
//                 fraction of the new span, unless that is less safe than the threshold of the build.
//   temperatures  The rows of high and of low temperatures move with their limit.
//   currents      The continuous limit: derating, overload integral, excess charge.
//   delays        No row of a voltage or a temperature waits longer; those with 0.2 s stay.
//   unchanged     deep discharge, short circuit, plausibility, and the second line of the front end, which remains
//   wider
//                 and slower because the first line only gets narrower and faster
#pragma once

#include <algorithm>
#include <cstdint>

#include "parameters/parameter.hpp"
#include "protection/protection.hpp"

namespace bms::parameters {

/// Moves voltages from the span of the build to the new one.
struct SpanMap {
  std::int64_t min_uv, span_uv, new_min_uv, new_span_uv;

  /// of: the number of cells whose sum it is
  constexpr std::int32_t at(std::int32_t uv, std::int64_t of = 1) const {
    return static_cast<std::int32_t>(of * new_min_uv + (uv - of * min_uv) * new_span_uv / span_uv);
  }
  constexpr std::int32_t lower(std::int32_t uv, std::int64_t of = 1) const { return std::min(uv, at(uv, of)); }
  constexpr std::int32_t higher(std::int32_t uv, std::int64_t of = 1) const { return std::max(uv, at(uv, of)); }
};

constexpr SpanMap span_map(const protection::ProtectionPlan& base, const Values& values) {
  const std::int64_t min_uv = base.derating.discharge_voltage.from, max_uv = base.derating.charge_voltage.to,
                     new_min_uv = std::max<std::int64_t>(min_uv, 1'000 * at(values, Parameter::cell_voltage_min)),
                     new_max_uv = std::min<std::int64_t>(max_uv, 1'000 * at(values, Parameter::cell_voltage_max));
  return {min_uv, max_uv - min_uv, new_min_uv, new_max_uv - new_min_uv};
}

/// Steps to the safe side [0.01 K].
struct TemperatureSteps {
  std::int32_t hot, cold, cold_charge;
};
constexpr TemperatureSteps temperature_steps(const Values& values, const Ranges& ranges) {
  const auto step = [&](Parameter p) { return 10 * protection::magnitude(at(ranges, p).initial - at(values, p)); };
  return {step(Parameter::temperature_max), step(Parameter::temperature_min), step(Parameter::charge_temperature_min)};
}

constexpr void tighten(protection::Rule& rule, const SpanMap& volts, std::int64_t cells, const TemperatureSteps& steps,
                       const Values& values) {
  using protection::Fault, protection::Quantity;
  constexpr std::uint32_t severe_us = 200'000;
  const auto at_most_ms = [&](Parameter p) {
    if (rule.delay_us > severe_us)
      rule.delay_us = std::min(rule.delay_us, 1'000 * static_cast<std::uint32_t>(at(values, p)));
  };
  const auto move = [&](auto&& to) {
    rule.threshold = to(rule.threshold);
    rule.release = to(rule.release);
  };
  switch (rule.quantity) {
    case Quantity::highest_cell_uv:
      move([&](std::int32_t uv) { return volts.lower(uv); });
      return at_most_ms(Parameter::voltage_delay);
    case Quantity::lowest_cell_uv:
      if (rule.fault == Fault::deep_discharge) return;
      move([&](std::int32_t uv) { return volts.higher(uv); });
      return at_most_ms(Parameter::voltage_delay);
    case Quantity::pack_uv: {
      const bool high = rule.sense == protection::Sense::above;
      move([&](std::int32_t uv) { return high ? volts.lower(uv, cells) : volts.higher(uv, cells); });
      return at_most_ms(Parameter::voltage_delay);
    }
    case Quantity::highest_cdegc:
      move([&](std::int32_t cdegc) { return cdegc - steps.hot; });
      return at_most_ms(Parameter::temperature_delay);
    case Quantity::lowest_cdegc: {
      const bool charge = rule.fault == Fault::charge_undertemperature;
      move([&](std::int32_t cdegc) { return cdegc + (charge ? steps.cold_charge : steps.cold); });
      return at_most_ms(Parameter::temperature_delay);
    }
    default:
      return;
  }
}

constexpr void move(protection::Ramp& ramp, std::int32_t step) {
  ramp.from += step;
  ramp.to += step;
}

constexpr void tighten_currents(protection::ProtectionPlan& plan, const Values& values, const Ranges& ranges) {
  constexpr std::int32_t ua_per_unit = 100'000;
  const auto limit_ua = [&](Parameter p, std::int32_t of_build) {
    return at(values, p) == at(ranges, p).initial ? of_build : std::min(of_build, ua_per_unit * at(values, p));
  };
  const auto overload = [](std::int32_t& part, std::int32_t ua) {
    part = std::min(part, std::max<std::int32_t>(ua / 256 * 105 / 100, 1));
  };
  plan.derating.charge_max_ua = limit_ua(Parameter::charge_current_max, plan.derating.charge_max_ua);
  plan.derating.discharge_max_ua = limit_ua(Parameter::discharge_current_max, plan.derating.discharge_max_ua);
  plan.excess.charge_max_ua = plan.derating.charge_max_ua;
  plan.excess.discharge_max_ua = plan.derating.discharge_max_ua;
  if (at(values, Parameter::charge_current_max) != at(ranges, Parameter::charge_current_max).initial)
    overload(plan.limits.charge_ua_256th, plan.derating.charge_max_ua);
  if (at(values, Parameter::discharge_current_max) != at(ranges, Parameter::discharge_current_max).initial)
    overload(plan.limits.discharge_ua_256th, plan.derating.discharge_max_ua);
  const std::int64_t capacity = at(values, Parameter::capacity), of_build = at(ranges, Parameter::capacity).initial;
  const auto part_of = [&](std::int64_t value) { return value * capacity / of_build; };
  plan.excess.part_ua = std::max(static_cast<std::int32_t>(part_of(plan.excess.part_ua)), std::int32_t{1});
  plan.recovery_ua = std::min(static_cast<std::int32_t>(part_of(plan.recovery_ua)), plan.derating.charge_max_ua);
  plan.balancing.uams_per_ppb = part_of(plan.balancing.uams_per_ppb);
}

/// Makes `plan`, a copy of the one of the build, that of these values. They must be possible.
constexpr void tighten(protection::ProtectionPlan& plan, const Values& values, const Ranges& ranges,
                       std::uint32_t sample_us) {
  const SpanMap volts = span_map(plan, values);
  const TemperatureSteps steps = temperature_steps(values, ranges);
  for (protection::Rule& rule : plan.rules) tighten(rule, volts, plan.cells, steps, values);
  protection::DeratingPlan& d = plan.derating;
  d.charge_voltage.from = volts.lower(d.charge_voltage.from);
  d.charge_voltage.to = volts.lower(d.charge_voltage.to);
  d.discharge_voltage.from = volts.higher(d.discharge_voltage.from);
  d.discharge_voltage.to = volts.higher(d.discharge_voltage.to);
  move(d.charge_warm, -steps.hot);
  move(d.discharge_warm, -steps.hot);
  move(d.charge_cold, steps.cold_charge);
  move(d.discharge_cold, steps.cold);
  tighten_currents(plan, values, ranges);
  const auto half_us = static_cast<std::uint32_t>(500 * at(values, Parameter::precharge_time));
  plan.contactors.half_time_constant_us = half_us;
  plan.contactors.test_us = std::max(half_us, 3 * sample_us);
  if (at(values, Parameter::closing_difference) != at(ranges, Parameter::closing_difference).initial)
    plan.contactors.max_closing_gap_uv = 1'000 * at(values, Parameter::closing_difference);
}

/// Returns true if a tightened plan is one with which every check works: no release on the wrong side of its threshold,
/// ramps that rise, and a cell that is not empty before it is full.
constexpr bool sound(const protection::ProtectionPlan& plan) {
  using protection::Fault;
  const auto rises = [](const protection::Ramp& r) { return r.from < r.to; };
  const protection::DeratingPlan& d = plan.derating;
  return protection::consistent(plan.rules) && rises(d.charge_voltage) && rises(d.discharge_voltage) &&
         rises(d.charge_warm) && rises(d.discharge_warm) && rises(d.charge_cold) && rises(d.discharge_cold) &&
         plan.rule(Fault::cell_undervoltage).release < plan.rule(Fault::cell_overvoltage).release &&
         plan.rule(Fault::undertemperature).release < plan.rule(Fault::overtemperature).release &&
         plan.rule(Fault::charge_undertemperature).release < plan.rule(Fault::charge_overtemperature).release &&
         d.charge_max_ua > plan.contactors.rest_ua && d.discharge_max_ua > plan.contactors.rest_ua &&
         plan.contactors.half_time_constant_us > 0 && plan.contactors.max_closing_gap_uv > 0 && plan.excess.part_ua > 0;
}

/// Returns true if the plan is sound in every corner of the ranges. Every value between them is then sound too, because
/// each threshold is a monotone function of each parameter, and so are the differences that sound() compares.
constexpr bool proved(const protection::ProtectionPlan& base, const Ranges& ranges, std::uint32_t sample_us) {
  constexpr Parameter of_limits[] = {Parameter::cell_voltage_max,   Parameter::cell_voltage_min,
                                     Parameter::temperature_max,    Parameter::temperature_min,
                                     Parameter::charge_current_max, Parameter::charge_temperature_min};
  for (unsigned corner = 0; corner < 1U << std::size(of_limits); ++corner) {
    Values values = initial_values(ranges);
    for (std::size_t k = 0; k < std::size(of_limits); ++k)
      at(values, of_limits[k]) =
          (corner >> k & 1) != 0 ? at(ranges, of_limits[k]).highest : at(ranges, of_limits[k]).lowest;
    // what no comparison joins with the others goes with the first one
    for (const Parameter p : {Parameter::discharge_current_max, Parameter::voltage_delay, Parameter::temperature_delay,
                              Parameter::capacity, Parameter::precharge_time, Parameter::closing_difference})
      at(values, p) = (corner & 1) != 0 ? at(ranges, p).highest : at(ranges, p).lowest;
    protection::ProtectionPlan plan = base;
    tighten(plan, values, ranges, sample_us);
    if (!sound(plan)) return false;
  }
  return true;
}

}  // namespace bms::parameters
