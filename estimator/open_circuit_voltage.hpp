// Open-circuit voltage of a cell that carries a current, for batteries that are to be connected in parallel.
//
//   by the model     OCV at the estimated SOC, and the voltages of the mechanisms
//   by the reading   what is read, less the drop over R0 and R1
//
// Each is wrong by something else: the first one by the SOC and the curve, the second one by the resistances, so not at
// rest. The result is their mean, each with the inverse of its variance: at rest the reading decides, under a large
// current the model. Batteries of a group have up to twice the resistance of a new one (firmware/parallel/README.md),
// so the drop is known to no better than itself. Memory: none.
#pragma once

#include <cstdint>
#include <type_traits>

#include "estimator/estimate.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "measurement/sample.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

/// [uV]. measurement::no_reading while the estimator has not started, and without a current. estimate: of this sample.
/// For floating point only.
template <class Estimator, class Cell, class S = typename Cell::Scalar>
std::int32_t open_circuit_uv(const Cell& cell, const measurement::Sample& sample, const Estimate<S>& estimate,
                             const Estimator& estimator) {
  static_assert(std::is_floating_point_v<S>);
  using namespace model;
  using Model = typename Estimator::Model;
  constexpr std::uint32_t useless = not_started | not_a_number | current_missing | current_implausible,
                          unread = voltage_missing | voltage_implausible | voltage_stuck;
  if ((estimate.flags & useless) != 0 || sample.current_ua == measurement::no_reading) return measurement::no_reading;
  const auto& laws = laws_of(cell);
  const auto& x = estimator.state().model_state;
  const S current_a =
      laws.true_current(Model::without_offset(arithmetic::from_micro<Current<S>>(sample.current_ua), x, cell.noise));
  const StepInput<S> input{current_a, S(0),
                           measurement::temperature_possible(sample.temperature_cdegc)
                               ? laws.true_temperature(arithmetic::from_centi<Temperature<S>>(sample.temperature_cdegc))
                               : Temperature<S>(assumed_ambient_c)};
  std::uint8_t interval = 0;
  const auto at = look_up(OperatingPoint{cell, input, Model::mechanism_states(x)}, estimate.soc, interval);
  const S drop_v = x[0] + at.r0_ohm * current_a,
          model_v = Model::true_voltage(laws, Model::voltage(laws, x, at, input));
  S open_circuit_v = model_v - drop_v;
  if ((estimate.flags & unread) == 0 && sample.voltage_uv != measurement::no_reading) {
    const S read_v = Model::true_voltage(laws, arithmetic::from_micro<Voltage<S>>(sample.voltage_uv)),
            of_soc_v = ocv_slope<S>(at) * estimate.soc_sigma, model_v2 = at.error_v2 + of_soc_v * of_soc_v,
            read_v2 = cell.noise.voltage_v2 + drop_v * drop_v;
    open_circuit_v += (read_v - model_v) * model_v2 / (model_v2 + read_v2);
  }
  return arithmetic::to_micro(open_circuit_v);
}

}  // namespace bms::estimator
