// State of function: the current that a cell can deliver or accept for a given time within its limits. It is computed
// with the model that the filter steps: bisection finds the constant current that ends at a voltage limit. The result
// is at most the current limit of the cell file.
//
//   V(I, t) = voltage of the model after t seconds of I from the present state, with the SOC moved by I t
//
// V rises with I. Cost: 2 x 16 steps of the model without its covariance, so the limits are computed when they are
// needed, not with every sample.
#pragma once

#include <cstdint>

#include "model/extended_rc.hpp"

namespace bms::estimator {

template <class S>
struct CurrentLimits {
  arithmetic::Current<S> discharge_a{}, charge_a{};  ///< both >= 0
};

/// x: state of the filter. off: possible error of soc, e.g. its standard deviation; discharge starts from soc - off,
/// charge from soc + off. duration_s: of the current, > 0. margin_v: distance of the voltage from its limits, e.g. one
/// standard deviation of the model's error.
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
  /// The largest current up to most_a that is good; 0 if no current is.
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
