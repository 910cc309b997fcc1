// Checks that the mechanisms of a cell file together still describe a cell. Each parameter can be within its bounds
// while all of them together move the open-circuit voltage by volts (an activation energy, far from its reference
// temperature). With such a file the estimator is wrong and certain, so that it must be rejected.
#pragma once

#include <cmath>
#include <optional>
#include <span>

#include "model/extended.hpp"

namespace bms::model {

/// Allowed distance of the voltage at rest from the OCV table [V]. Measured: 0.27 V at most, at -30 degrees C and 10 %
/// (a123_26650_extended), which is 8 times the gap at 25 degrees C.
inline constexpr double most_ocv_shift_v = 0.5;

/// A place at which the voltage at rest is impossible.
struct ImpossibleOcv {
  double soc = 0, temperature_c = 0;
  double shift_v = 0;  ///< voltage at rest minus the OCV of the table, on the branch that is farther away
  double gap_v = 0;    ///< charge minus discharge branch; below 0: the branches are exchanged
};

struct AtRest {
  double voltage_v = 0, r0_ohm = 0, r1_ohm = 0;
};

/// The cell at rest on the branch to which a current of this sign leads, before any sensor.
inline AtRest at_rest(const Cell<double, max_intervals>& cell, const ChosenLaws<double>& laws, double soc,
                      double temperature_c, double sign) {
  constexpr double hardly_a = 1e-9, duration_s = 1;
  const StepInput<double> input{sign * hardly_a, duration_s, temperature_c};
  std::uint8_t interval = 0;
  auto x = laws.initial();
  TablePoint<double> at = look_up(cell, soc, interval);
  const auto relaxations = laws.discretise(x, at, input);
  for (std::size_t k = 0; k < laws.states(); ++k) x[k] = relaxations[k].target;
  at.ocv_v = look_up(cell, laws.ocv_soc(soc, x), interval).ocv_v;
  laws.tables(at, soc, input, x);
  return {at.ocv_v + laws.advance(x, at, input, false), at.r0_ohm, at.r1_ohm};
}

/// Calls f(soc, temperature_c) over SOC and the temperatures that the file allows, until it returns false.
template <class F>
void for_each_condition(const CellParameters<>& cell, F&& f) {
  for (const double c : {cell.reference_temperature_c, cell.limits.temperature_min_c, cell.limits.temperature_max_c}) {
    for (int percent = 0; percent <= 100; percent += 5) {
      if (!f(percent / 100.0, c)) return;
    }
  }
}

/// The first place, over SOC and the temperatures that the file allows, at which the mechanisms move the voltage at
/// rest by more than most_ocv_shift_v or exchange the branches; none if the mechanisms describe a cell. `cell` has been
/// accepted by first_fault().
inline std::optional<ImpossibleOcv> first_impossible_ocv(const CellParameters<>& cell,
                                                         std::span<const MechanismSetting> mechanisms) {
  constexpr double rounding_v = 1e-6;
  const auto tables = prepare<double, max_intervals>(cell);
  const auto laws = chosen<double>(mechanisms, cell.capacity_ah);
  std::optional<ImpossibleOcv> first;
  for_each_condition(cell, [&](double soc, double c) {
    std::uint8_t interval = 0;
    const double table_v = look_up(tables, soc, interval).ocv_v;
    const double discharge_v = at_rest(tables, laws, soc, c, -1).voltage_v - table_v;
    const double charge_v = at_rest(tables, laws, soc, c, 1).voltage_v - table_v;
    const double shift_v = std::abs(charge_v) > std::abs(discharge_v) ? charge_v : discharge_v;
    const double gap_v = charge_v - discharge_v;
    if (!(std::abs(shift_v) <= most_ocv_shift_v && gap_v > -rounding_v)) first = {soc, c, shift_v, gap_v};
    return !first;
  });
  return first;
}

/// Returns true if fixed point holds the cell and these mechanisms: C1 is not too large, no value is rounded too much,
/// and no resistance saturates at a temperature that the file allows.
inline bool fits_fixed_point(const CellParameters<>& cell, std::span<const MechanismSetting> mechanisms) {
  bool fits = true;
  for (std::size_t k = 0; k < cell.rc.c1_f.size; ++k) fits = fits && cell.rc.c1_f[k] <= accepted::fixed_capacitance_f;
  for (const MechanismSetting& m : mechanisms)
    fits = fits && catalogue[m.index].fits_fixed_point(m.value, cell.capacity_ah);
  const double most_ohm = static_cast<double>(Resistance<FixedPoint>::highest());
  const auto tables = prepare<double, max_intervals>(cell);
  const auto laws = chosen<double>(mechanisms, cell.capacity_ah);
  for_each_condition(cell, [&](double soc, double c) {
    for (const double sign : {-1.0, 1.0}) {
      const AtRest rest = at_rest(tables, laws, soc, c, sign);
      fits = fits && rest.r0_ohm < most_ohm && rest.r1_ohm < most_ohm;
    }
    return fits;
  });
  return fits;
}

}  // namespace bms::model
