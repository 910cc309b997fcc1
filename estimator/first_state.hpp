// The state of an estimator at its first sample: from a starting point, from the first voltage, or from both.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "estimator/ambiguous_soc.hpp"
#include "estimator/cell_state.hpp"
#include "estimator/start.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "measurement/sample.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

/// The nearest possible starting point: SOC 0 to 1, sigma 1e-6 to 1.
constexpr measurement::StartingPoint possible(const measurement::StartingPoint& from) {
  return {std::clamp<std::int32_t>(from.soc_ppb, 0, 1'000'000'000),
          std::clamp<std::int32_t>(from.soc_sigma_ppb, 1'000, 1'000'000'000)};
}

/// Sets a state and opens its bank. The references are to the parts of one estimator.
template <class S, template <class> class ModelOf>
class FirstState {
  using Model = ModelOf<S>;
  using StepInput = model::StepInput<S>;
  using At = model::TablePoint<S>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Current = arithmetic::Current<S>;
  using Temperature = arithmetic::Temperature<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Variances = typename Model::Variances;

 public:
  constexpr FirstState(CellState<S, ModelOf>& state, AmbiguousSoc<S, ModelOf>& ambiguous, std::uint8_t& interval)
      : state_(state), ambiguous_(ambiguous), interval_(interval) {}

  /// from, voltage_uv: nullptr if it is missing; not both. Opens the bank if the SOC is ambiguous, and in the
  /// background if it was given. Returns the tables at the first SOC.
  template <class Cell>
  constexpr At set(const Cell& cell, const StepInput& input, bool current_measured,
                   const measurement::StartingPoint* from, const std::int32_t* voltage_uv) {
    SocDistribution<S> soc{Soc(0.5), Variance{}};
    if (from != nullptr) soc = given(*from);
    const auto tables = operating_point(cell, input);
    const At at = look_up(tables, soc.soc, interval_);
    const StartPolarisation<S> rc = start_polarisation<S>(at, input.current_a, cell.noise);
    Reading reading{};
    reading.of_states[0] = Variance(cell.noise.v_rc_v2 + rc.variance_v2);
    Model::start(laws_of(cell), state_.model_state, reading.of_states, at, input, cell.noise);
    const Variances variances = with_polarisation_before(cell, input, soc.soc, reading);
    // a start that is finer than the points of the grid needs no help from a voltage
    if (from == nullptr || soc_of_ppb(from->soc_sigma_ppb) > Soc(2.0 / start_points)) {
      reading.v2 = Variance(cell.noise.rest_v2 + rc.variance_v2);
      if (!current_measured) {
        const Voltage unknown_v = at.r0_ohm * cell.noise.unknown_a;
        reading.v2 = Variance(reading.v2 + unknown_v * unknown_v);
      }
      reading.above_v2 = Variance(Variance(reading.v2 - rc.before_v2) + rc.charged_before_v2);
      if (voltage_uv != nullptr) {
        const Voltage load_v = rc.v_rc_v + Model::sum_v(state_.model_state) + at.r0_ohm * input.current_a;
        reading.ocv_v = Model::true_voltage(laws_of(cell), arithmetic::from_micro<Voltage>(*voltage_uv)) - load_v;
        reading.present = true;
      }
      soc = read(cell, tables, input, from != nullptr, soc, reading);
    }
    state_.charge.set(soc.soc, cell.charge);
    state_.model_state[0] = rc.v_rc_v;
    Variances all = variances;
    all[Model::soc] = soc.variance;
    state_.covariance.set_diagonal(all);
    return look_up(tables, soc.soc, interval_);
  }

 private:
  /// The first voltage, as a reading of the OCV.
  struct Reading {
    bool present = false;
    Voltage ocv_v{};
    Variance v2{}, above_v2{};       ///< of the reading; of one above the curve
    Variances of_states{}, above{};  ///< of the states, in the same way
  };

  template <class Cell>
  constexpr auto operating_point(const Cell& cell, const StepInput& input) const {
    return model::OperatingPoint{cell, input, Model::mechanism_states(state_.model_state)};
  }

  template <class Cell, class Tables>
  constexpr SocDistribution<S> read(const Cell& cell, const Tables& tables, const StepInput& input, bool given_before,
                                    const SocDistribution<S>& before, const Reading& reading) {
    const auto of_mechanisms_v2 = [&](const At& there, bool above) {
      return sum_variance<Model>(above ? reading.above : reading.of_states,
                                 Model::measurement_jacobian(laws_of(cell), there, input),
                                 [](std::size_t k) { return k >= Model::first_voltage; });
    };
    StartMisfit<S, Tables, decltype(of_mechanisms_v2)> misfit{
        tables,           reading.present ? &reading.ocv_v : nullptr, reading.v2,
        reading.above_v2, given_before ? &before : nullptr,           of_mechanisms_v2};
    const SocDistribution<S> soc = reading.present ? soc_from(misfit) : before;
    const bool ambiguous = soc.variance > Variance(SocBank<S>::open_above_sigma * SocBank<S>::open_above_sigma);
    if (!ambiguous && !given_before) return soc;
    state_.covariance.set_diagonal(reading.of_states);  // the bank needs the variances of the other states
    misfit.wrong = WrongPrior::even_odds;
    ambiguous_.open_at(soc.soc, misfit, !ambiguous);
    return soc;
  }

  /// Adds what an unknown current before may have left in the mechanisms' polarisations. For a reading above the curve:
  /// in the cold, chargers reduce their current as the resistance increases (start_polarisation). Returns the variances
  /// of the states.
  template <class Cell>
  constexpr Variances with_polarisation_before(const Cell& cell, const StepInput& input, const Soc& soc,
                                               Reading& reading) const {
    reading.above = reading.of_states;
    if constexpr (Model::first_voltage < Model::soc) {
      const auto& laws = laws_of(cell);
      const bool warm = input.temperature_c > cell.reference.c || !rests<S>(input.current_a, cell.noise);
      const auto left_v = [&](const Temperature& c) {
        const StepInput unknown{cell.noise.unknown_a, input.duration_s, c};
        std::uint8_t interval = 0;
        return Model::final_voltages(laws, state_.model_state, look_up(operating_point(cell, unknown), soc, interval),
                                     unknown);
      };
      const auto below_v = left_v(input.temperature_c), above_v = left_v(warm ? input.temperature_c : cell.reference.c);
      for (std::size_t k = 0; Model::first_voltage + k < Model::soc; ++k) {
        if (!Model::is_polarisation(laws, Model::first_voltage + k)) continue;
        Variance &b = reading.of_states[Model::first_voltage + k], &a = reading.above[Model::first_voltage + k];
        b = Variance(b + below_v[1 + k] * below_v[1 + k]);
        a = Variance(a + above_v[1 + k] * above_v[1 + k]);
      }
    }
    return reading.of_states;
  }

  static constexpr SocDistribution<S> given(const measurement::StartingPoint& from) {
    const Soc sigma = soc_of_ppb(from.soc_sigma_ppb);
    return {soc_of_ppb(from.soc_ppb), Variance(sigma * sigma)};
  }
  static constexpr Soc soc_of_ppb(std::int32_t ppb) {
    return Soc(arithmetic::from_micro<Current>(ppb) * Fraction(1e-3));
  }

  CellState<S, ModelOf>& state_;
  AmbiguousSoc<S, ModelOf>& ambiguous_;
  std::uint8_t& interval_;
};

}  // namespace bms::estimator
