// Errors that persist for hours: the model's voltage error, the offset and the gain of the current sensor. The cell
// file chooses one of two policies (noise.errors_are_states):
//
//   PersistentErrorsInSigma    they only widen the standard deviations
//   PersistentErrorsAsStates   voltage error and offset are states of the filter (model/extended_rc.hpp). A current at
//                              rest measures the offset; the gain widens sigma with the charge counted since the SOC
//                              was last corrected
//
// Both have the same interface, so that the step is written once. What the first policy does not need compiles to
// nothing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "estimator/cell_state.hpp"
#include "estimator/current_at_rest.hpp"
#include "estimator/input_check.hpp"
#include "model/cell.hpp"

namespace bms::estimator {

/// Share of the variance of a persistent error that is uncorrelated after noise.model_correlation_s. Half of the
/// standard deviation comes and goes, half persists (model::persistent_error_correlations).
inline constexpr double uncorrelated_share = 1.0 / 4;

template <class S, template <class> class ModelOf>
class PersistentErrorsInSigma {
  using State = CellState<S, ModelOf>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Noise = model::FilterNoise<S>;

 public:
  static constexpr std::size_t values = 0;  ///< that an estimate reports
  /// Time over which an unknown influence of the temperature on the resistances lasts: that of the weather.
  static constexpr double temperature_lasts_s = 36'000;
  /// Time in which a polarisation relaxes whose time constant is not known.
  static constexpr double relaxation_lasts_s = 1'800;
  /// Variance of a voltage by the error of the resistances under a load of half an hour: lasts as long as the model's.
  struct LastingLoad {
    constexpr void add(const arithmetic::Current<S>&, const Fraction&) {}
    /// mean_v2: square of the mean overpotential.
    template <class Cell, class Constants>
    static constexpr Variance noise_v2(const Variance& mean_v2, const Cell&, const Constants& constants) {
      return arithmetic::product<Variance>(mean_v2, constants.known_noise());
    }
  };
  /// Which square of the overpotential of the last half hour an unknown temperature makes uncertain: the time constants
  /// are unknown as well, so a load and its return do not cancel.
  static constexpr const Variance& past_load_v2(const Variance&, const Variance& mean_square_v2) {
    return mean_square_v2;
  }

  /// Process noise of the SOC in a step: white noise of the current sensor, and its slow error as a random walk.
  static constexpr Variance soc_noise(const Variance& white, const Noise& noise,
                                      const arithmetic::TimeStep<S>& duration_s) {
    return white + arithmetic::product<Variance>(noise.walk_soc2_per_s, duration_s);
  }
  /// By how much the variance of the counted charge grows in a time. before_soc2: what it was.
  static constexpr Variance counted_variance(const State&, const Noise& noise, const Variance&,
                                             const arithmetic::TimeStep<S>& duration_s) {
    return arithmetic::product<Variance>(noise.walk_soc2_per_s, duration_s);
  }
  /// Variance of that part of the model's voltage error which the filter does not estimate. error_v2: all of it at this
  /// SOC; soc_axis_v2(): its part from the SOC axis of the tables.
  template <class F>
  static constexpr Variance error_in_noise(const Noise&, const Variance& error_v2, F&&) {
    return error_v2;
  }
  /// The same part while the bank of hypotheses is open, without the SOC axis.
  static constexpr Variance model_error_in_bank(const Noise& noise) { return noise.model_v2; }
  /// Variance of the model's error in a voltage from which the estimated error was not subtracted, in addition to the
  /// variances of the states.
  static constexpr Variance model_error_beyond_states(const Noise&) { return Variance{}; }

  /// A predicted voltage without the estimated error of the voltage.
  static constexpr Voltage without_error(const State&, const Voltage& v) { return v; }
  /// An innovation with it: the deviation from the model.
  static constexpr Voltage with_error(const State&, const Voltage& v) { return v; }

  constexpr void start(const Soc&) {}
  constexpr void add_gain_error(Variance&, const Soc&, const Fraction&) {}
  constexpr void bound_gain_error(const Soc&, const Soc&, const Fraction&) {}
  template <class Cell>
  constexpr void update_offset_at_rest(State&, const Cell&, const AcceptedCurrent&, std::uint64_t,
                                       const arithmetic::TimeStep<S>&) {}
  template <class Values>
  static constexpr void report(const State&, Values&) {}
};

template <class S, template <class> class ModelOf>
class PersistentErrorsAsStates {
  using Model = ModelOf<S>;
  using State = CellState<S, ModelOf>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Current = arithmetic::Current<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Count = arithmetic::Count<S>;
  using Noise = model::FilterNoise<S>;

 public:
  static constexpr std::size_t values = 3;  ///< voltage error, current offset, standard deviation of the offset
  /// As long as the model's error, a state that takes up what lasts longer.
  static constexpr double temperature_lasts_s = 0, relaxation_lasts_s = 0;
  /// The same. The error of the resistances is a function of the SOC (model/mechanisms/temperature_resistance.hpp has
  /// nodes at 10, 25 and 80 %): a slow charge meets the same error for hours. What the voltage error that is a state
  /// can take up counts once in the time of the model's error, what is more once while the SOC stays nearby.
  class LastingLoad {
   public:
    /// SOC over which it is one error, and the longest time that one counts: a working day.
    static constexpr double soc_span = 0.2, longest_s = 36'000;

    /// share: of this check in the mean of half an hour.
    constexpr void add(const Current& current_a, const Fraction& share) {
      mean_a_ = Current(mean_a_ + share * Current(current_a - mean_a_));
    }
    template <class Cell, class Constants>
    constexpr Variance noise_v2(const Variance& mean_v2, const Cell& cell, const Constants& constants) const {
      const auto error_v2 = arithmetic::product<Variance>(mean_v2, constants.known_error2());
      const auto in_state_v2 = arithmetic::product<Variance>(cell.noise.model_v2, Fraction(1 - uncorrelated_share));
      const auto once_v2 = arithmetic::product<Variance>(error_v2, constants.correlated_samples());
      if (!(error_v2 > in_state_v2)) return once_v2;
      const auto slowest = Soc(soc_span / longest_s);
      const Soc per_s = arithmetic::magnitude(Soc(mean_a_ * cell.limits.soc_per_as));
      const auto lasts_s = arithmetic::ratio<arithmetic::Duration<S>>(Soc(soc_span), per_s > slowest ? per_s : slowest);
      const auto more = Count(constants.samples_in(lasts_s) - constants.correlated_samples());
      return Variance(once_v2 + arithmetic::product<Variance>(Variance(error_v2 - in_state_v2), more));
    }

   private:
    Current mean_a_{};
  };
  static constexpr const Variance& past_load_v2(const Variance& squared_mean_v2, const Variance&) {
    return squared_mean_v2;
  }

  static constexpr Variance soc_noise(const Variance& white, const Noise&, const arithmetic::TimeStep<S>&) {
    return white;
  }
  /// The offset keeps its sign, so standard deviations add: (sigma + d)^2 - sigma^2.
  static constexpr Variance counted_variance(const State& state, const Noise&, const Variance& before_soc2,
                                             const arithmetic::TimeStep<S>& duration_s) {
    const Soc per_h = arithmetic::root<Soc>(state.covariance.template variance<Model::last>());
    const Soc d = Soc(Soc(per_h * Fraction(1.0 / 3'600)) * duration_s), sigma = arithmetic::root<Soc>(before_soc2);
    return Variance(Variance(d * d) + Variance((sigma + sigma) * d));
  }
  template <class F>
  static constexpr Variance error_in_noise(const Noise& noise, const Variance&, F&& soc_axis_v2) {
    // the axis of the tables is off by one constant, so it counts once while the error of the voltage persists
    return Variance(arithmetic::product<Variance>(noise.model_v2, Fraction(uncorrelated_share)) +
                    arithmetic::product<Variance>(soc_axis_v2(), Count(model::persistent_error_correlations)));
  }
  static constexpr Variance model_error_in_bank(const Noise&) { return Variance{}; }
  static constexpr Variance model_error_beyond_states(const Noise& noise) { return noise.model_v2; }

  static constexpr Voltage without_error(const State& state, const Voltage& v) {
    return Voltage(v - state.model_state[Model::voltage_error]);
  }
  static constexpr Voltage with_error(const State& state, const Voltage& v) {
    return Voltage(v + state.model_state[Model::voltage_error]);
  }

  constexpr void start(const Soc& soc) { corrected_soc_ = soc; }

  /// Adds to the SOC's process noise what a wrong gain makes of the charge c that was counted since the SOC was last
  /// corrected. Its standard deviation is gain * c, so a step that counts d adds gain^2 ((c + d)^2 - c^2). Charge that
  /// comes back would reduce it, which a covariance cannot express: then the variance stays.
  constexpr void add_gain_error(Variance& soc_noise, const Soc& soc, const Fraction& gain) {
    soc_noise = Variance(soc_noise + gain_variance(Soc(soc - corrected_soc_), gain));
  }

  /// Limits the counted charge, so that the gain's part of sigma is not more than sigma. soc, sigma: after the
  /// correction.
  constexpr void bound_gain_error(const Soc& soc, const Soc& sigma, const Fraction& gain) {
    corrected_soc_ = soc;
    if (!(arithmetic::magnitude(Soc(counted_ * gain)) > sigma)) return;
    const auto most = arithmetic::ratio<Soc>(sigma, Soc(gain));
    counted_ = counted_ > Soc(0) ? most : Soc(-most);
  }

  /// A current at rest measures the sensor's offset beyond the cell file's, except for what may flow at rest.
  template <class Cell>
  constexpr void update_offset_at_rest(State& state, const Cell& cell, const AcceptedCurrent& current,
                                       std::uint64_t step_us, const arithmetic::TimeStep<S>& duration_s) {
    if (!(cell.noise.at_rest_per_h2 > Variance(0))) return;
    if (!current.measured) return at_rest_.reset();
    if (!at_rest_.is_at_rest(current.ua, step_us, cell.noise.at_rest)) return;
    const auto correlated_samples =
        arithmetic::ratio<Count>(arithmetic::Duration<S>(static_cast<int>(CurrentAtRest::correlation_s)), duration_s);
    const Voltage read = arithmetic::ratio<Voltage>(
        Current(laws_of(cell).true_current(arithmetic::from_micro<Current>(current.ua))), cell.noise.one_c_a);
    typename Model::MeasurementJacobian h{};
    h[Model::last] = arithmetic::VoltagePerSoc<S>(1);
    const Variance noise = arithmetic::product<Variance>(cell.noise.at_rest_per_h2,
                                                         correlated_samples > Count(1) ? correlated_samples : Count(1));
    state.apply(state.covariance.observe(h, noise, Voltage(read - state.model_state[Model::current_offset])),
                cell.charge);
  }

  /// The first `values` of an estimate's extra values.
  template <class Values>
  static constexpr void report(const State& state, Values& extra) {
    extra[0] = state.model_state[Model::voltage_error];
    extra[1] = state.model_state[Model::current_offset];
    extra[2] = arithmetic::root<Voltage>(state.covariance.template variance<Model::last>());
  }

 private:
  constexpr Variance gain_variance(const Soc& d, const Fraction& gain) {
    const Soc before = counted_;
    counted_ = Soc(before + d);
    const Variance more = Variance((before + counted_) * d);
    return more > Variance(0) ? arithmetic::product<Variance>(arithmetic::product<Variance>(more, gain), gain)
                              : Variance(0);
  }

  Soc corrected_soc_{};  ///< after the last sample
  Soc counted_{};        ///< charge since the SOC was last corrected, in capacities
  CurrentAtRest at_rest_;
};

/// The policy that the model's states ask for.
template <class S, template <class> class ModelOf>
using PersistentErrors = std::conditional_t<ModelOf<S>::errors_are_states, PersistentErrorsAsStates<S, ModelOf>,
                                            PersistentErrorsInSigma<S, ModelOf>>;

}  // namespace bms::estimator
