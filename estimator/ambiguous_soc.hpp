// The state of charge while more than one value fits the voltages: connects the bank of hypotheses (soc_bank.hpp) to
// the state of the filter. While the bank is open, it corrects the SOC; the other states follow the prediction.
#pragma once

#include <cstddef>
#include <cstdint>

#include "estimator/cell_state.hpp"
#include "estimator/persistent_errors.hpp"
#include "estimator/soc_bank.hpp"
#include "estimator/step_constants.hpp"
#include "estimator/voltage_uncertainty.hpp"

namespace bms::estimator {

template <class S, template <class> class ModelOf>
class AmbiguousSoc {
  using Model = ModelOf<S>;
  using Errors = PersistentErrors<S, ModelOf>;
  using State = CellState<S, ModelOf>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;

 public:
  constexpr bool open() const { return bank_.open(); }

  /// Starts the bank. mean: SOC of the filter; misfit(soc, half a step of the grid, interval): >= 0.
  template <class Cell, class Misfit>
  constexpr void open_at(const Cell& cell, const State& state, const Soc& mean, const Misfit& misfit) {
    std::uint8_t interval = 0;
    bank_.open_at(mean, persistent_variance(cell.noise, state),
                  [&](const Soc& soc) { return misfit(soc, half_step(), interval); });
  }

  /// One sample: updates the bank and, when it has a result, the SOC of the state. soc: predicted; interval: of soc.
  template <class Cell, class Constants>
  constexpr void update(const Cell& cell, const model::StepInput<S>& input, const Constants& constants, const Soc& soc,
                        const Voltage& innovation_v, std::uint8_t interval, State& state) {
    const auto& laws = laws_of(cell);
    const model::OperatingPoint operating_point{cell, input, Model::mechanism_states(state.model_state)};
    const auto middle = look_up(operating_point, soc, interval);
    const Voltage expected_v = Model::voltage(laws, state.model_state, middle, input);
    const Variance drop_v2 = drop_variance_v2<S>(middle, input.current_a, constants.resistance_error());
    const Variance new_v2 =
        Variance(arithmetic::product<Variance>(cell.noise.model_v2, Fraction(uncorrelated_share)) + drop_v2);
    const auto observation = [&](const Soc& there) -> typename SocBank<S>::Observation {
      const auto at = look_up(operating_point, there, interval);
      return {.off_v = Voltage(innovation_v + (expected_v - Model::voltage(laws, state.model_state, at, input))),
              .half_v = Voltage(ocv_slope<S>(at) * half_step()),
              .new_v2 = Variance(new_v2 + soc_axis_variance<S>(cell, at))};
    };
    const auto result = bank_.step(soc, constants.bank_share(), cell.noise.voltage_v2,
                                   Variance(persistent_variance(cell.noise, state) + drop_v2), observation);
    if (!result.ready) return;
    state.charge.correct(result.moved, cell.charge);
    state.covariance.template reset<Model::soc>(result.variance);
    if (result.variance < Variance(SocBank<S>::close_below_sigma * SocBank<S>::close_below_sigma)) bank_.close();
  }

  /// Variance of the voltage errors that persist while the bank is open: the model's, and those of the states that are
  /// not corrected then.
  static constexpr Variance persistent_variance(const model::FilterNoise<S>& noise, const State& state) {
    Variance sum = Errors::model_error_in_bank(noise);
    const auto states_v2 = state.covariance.variances();
    for (std::size_t k = 0; k < Model::soc; ++k) sum = Variance(sum + states_v2[k]);
    return sum;
  }

 private:
  static constexpr Fraction half_step() { return Fraction(0.5 / SocBank<S>::points); }

  SocBank<S> bank_;
};

}  // namespace bms::estimator
