// What a cell can give and take for a while without leaving its limits of use (state of function), by the very model
// that the filter steps: the constant current that ends at a voltage limit, found by halving; no more than the cell
// file allows anyway.
//
//   V(I, t) = voltage of the model after t seconds of I from the present state, soc moved by I t
//
// V rises with I. Cost: 2 x 16 steps of the model without its covariance, so it is asked for when it is told, not with
// every sample.
#pragma once

#include <cstdint>

#include "model/extended_rc.hpp"

namespace bms::estimator {

template <class S>
struct CurrentLimits {
  arithmetic::Current<S> discharge_a{}, charge_a{};  ///< both >= 0
};

/// x: of the filter. off: how far soc may be off, e.g. its standard deviation: what is drawn is reckoned from the
/// lower, what is charged from the higher. duration_s: how long the current lasts, above 0. margin_v: by how much less
/// than the limits the voltage may reach, e.g. one standard deviation of the model's error.
template <class Model, class Cell, class S = typename Cell::Scalar>
constexpr CurrentLimits<S> current_limits(const Cell& cell, const typename Model::State& x,
                                          const arithmetic::Soc<S>& soc, const arithmetic::Soc<S>& off,
                                          const arithmetic::Temperature<S>& temperature_c,
                                          const arithmetic::TimeStep<S>& duration_s,
                                          const arithmetic::Voltage<S>& margin_v) {
  using namespace model;
  constexpr int halvings = 16;
  const auto& laws = laws_of(cell);
  std::uint8_t interval = 0;
  const auto voltage_after = [&](const Current<S>& current_a) {
    const StepInput<S> input{current_a, duration_s, temperature_c};
    const Rate<S> per_s = current_a * cell.limits.soc_per_as;
    const Soc<S> start = current_a < Current<S>(0) ? Soc<S>(soc - off) : Soc<S>(soc + off);
    const Soc<S> end = start + duration_s * per_s;
    const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(x)}, end, interval);
    return Voltage<S>(
        Model::voltage(laws, Model::advance(x, at, Model::discretise(laws, x, at, input), input), at, input));
  };
  /// The largest current of that sign, up to most, that is good; 0 where none is.
  const auto largest = [&](const Current<S>& most_a, const auto& good) {
    if (good(most_a)) return most_a;
    Current<S> low_a(0), high_a = most_a;
    for (int k = 0; k < halvings; ++k) {
      const Current<S> middle_a = Current<S>(low_a + high_a) * Fraction<S>(0.5);
      if (good(middle_a))
        low_a = middle_a;
      else
        high_a = middle_a;
    }
    return low_a;
  };
  const Voltage<S> lowest_v = cell.limits.voltage_min_v + margin_v, highest_v = cell.limits.voltage_max_v - margin_v;
  return {largest(cell.limits.discharge_max_a,
                  [&](const Current<S>& a) { return voltage_after(Current<S>(-a)) > lowest_v; }),
          largest(cell.limits.charge_max_a, [&](const Current<S>& a) { return voltage_after(a) < highest_v; })};
}

}  // namespace bms::estimator
