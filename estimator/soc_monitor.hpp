// Finds out when the voltages contradict the state of charge: single voltages that are outliers (outlier_gate.hpp), a
// mean over half an hour that is inconsistent (consistency.hpp), a SOC that no cell can have, or a bank of hypotheses
// that prefers another SOC (ambiguous_soc.hpp). Then the bank estimates the SOC again, with a wider sigma.
//
// An ordinary step only compares its innovation with a limit (is_due).
#pragma once

#include <cstddef>
#include <cstdint>

#include "estimator/ambiguous_soc.hpp"
#include "estimator/cell_state.hpp"
#include "estimator/consistency.hpp"
#include "estimator/estimate.hpp"
#include "estimator/outlier_gate.hpp"
#include "estimator/persistent_errors.hpp"
#include "estimator/start.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

template <class S, template <class> class ModelOf>
class SocMonitor {
  using Model = ModelOf<S>;
  using Errors = PersistentErrors<S, ModelOf>;
  using State = CellState<S, ModelOf>;
  using StepInput = model::StepInput<S>;
  using Soc = arithmetic::Soc<S>;
  using Current = arithmetic::Current<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Count = arithmetic::Count<S>;

 public:
  /// Variance of the model's error in the bank after a contradiction, in addition to the expected one: the model may be
  /// three times as wrong as its file says.
  static constexpr double model_error_factor = 8;
  /// Sigma of the SOC when it is estimated again: this many times as wide, and at least that wide.
  static constexpr double wider_sigma = 3, least_sigma = 2 * SocBank<S>::close_below_sigma;

  template <class Cell>
  constexpr void start(const Cell& cell) {
    reading_noise_v2_ = cell.noise.voltage_v2;
  }
  constexpr AmbiguousSoc<S, ModelOf>& bank() { return bank_; }
  constexpr bool bank_is_open() const { return bank_.open(); }

  /// The next sample is checked.
  constexpr void force_check() { consistency_.force_check(); }
  constexpr bool is_due(const Voltage& innovation_v) const { return consistency_.is_due(innovation_v); }
  /// Variance of a reading: its own noise, and the error of the overpotential of the last half hour.
  constexpr const Variance& reading_noise_v2() const { return reading_noise_v2_; }

  /// Updates the means over half an hour. above_ocv_v: predicted voltage above the OCV; measured: the current was.
  /// Returns the time since the last regular check; 0 if this is not one.
  template <class Cell, class Constants>
  constexpr std::uint32_t watch(const Cell& cell, const Constants& constants, const State& state, std::uint64_t time_us,
                                const Current& current_a, const Voltage& above_ocv_v, const Voltage& innovation_v,
                                bool measured) {
    const std::uint64_t since_us = consistency_.begin(time_us, bank_.open());
    if (since_us == 0) return 0;
    share_ = Consistency<S>::share_of(arithmetic::seconds<S>(Constants::capped(since_us)));
    if (measured) {
      consistency_.add(Errors::with_error(state, innovation_v), Errors::without_error(state, above_ocv_v), share_);
      load_.add(current_a, share_);
    }
    const Variance mean_v2 = consistency_.overpotential_v2(),
                   by_temperature_v2 = Errors::past_load_v2(mean_v2, consistency_.loads_v2());
    reading_noise_v2_ = Variance(
        cell.noise.voltage_v2 + Variance(load_.noise_v2(mean_v2, cell, constants) +
                                         arithmetic::product<Variance>(by_temperature_v2, constants.relaxing_noise())));
    if (constants.extrapolated() > Fraction(0)) [[unlikely]]
      reading_noise_v2_ = Variance(reading_noise_v2_ +
                                   arithmetic::product<Variance>(seen_v2(constants), constants.correlated_samples()));
    return Constants::capped(since_us);
  }

  constexpr bool needs_check(const Soc& soc, const Voltage& innovation_v) const {
    return bank_.open() || is_suspect(soc, innovation_v);
  }
  /// Variance of the present overpotential, and of what that of the last half hour left.
  template <class Constants>
  constexpr Variance resistance_error_v2(const Constants& constants, const Voltage& above_ocv_v,
                                         const State& state) const {
    const Voltage present_v = Errors::without_error(state, above_ocv_v);
    const Variance mean_v2 = consistency_.overpotential_v2(), present_v2 = present_v * present_v,
                   by_temperature_v2 = Errors::past_load_v2(mean_v2, consistency_.loads_v2());
    Variance of_known_v2 = arithmetic::product<Variance>(Variance(present_v2 + mean_v2), constants.known_error2());
    // not seen_ while the bank only watches: the gate would let an outlier widen itself
    if (judged_by_bank())
      of_known_v2 = Variance(of_known_v2 + Variance(Variance(present_v2 + mean_v2) * seen_.overpotential2));
    else
      of_known_v2 = Variance(of_known_v2 + seen_v2(constants));
    return Variance(of_known_v2 + arithmetic::product<Variance>(Variance(present_v2 + by_temperature_v2),
                                                                constants.temperature_error2()));
  }

  /// Returns 0 if the filter may use the voltage; else the flags of a voltage that it may not use. interval: of soc.
  template <class Cell, class Constants>
  [[gnu::noinline]] constexpr std::uint32_t judge(const Cell& cell, const StepInput& input, const Constants& constants,
                                                  const Soc& soc, const Voltage& innovation_v,
                                                  const Variance& of_resistances_v2, std::uint8_t interval,
                                                  State& state) {
    if (bank_.open() &&
        correct_from_bank(cell, input, constants, soc, innovation_v, of_resistances_v2, interval, state))
      return contradicted_ ? soc_ambiguous | soc_contradicted : std::uint32_t{soc_ambiguous};
    if (!is_suspect(soc, innovation_v)) return 0;
    return judge_deviation(cell, input, soc, innovation_v, of_resistances_v2, interval, state);
  }

  /// The filter corrected its SOC by `by` while the bank is open in the background.
  constexpr void follow(const Soc& by) { bank_.follow(by); }

 private:
  friend struct LaneAccess;

  /// The bank has the SOC.
  constexpr bool judged_by_bank() const { return bank_.open() && !bank_.in_background(); }
  /// Variance of a voltage by a model that is used at another temperature than it was identified at: it is as wrong
  /// there as it was in the last half hour.
  template <class Constants>
  constexpr Variance seen_v2(const Constants& constants) const {
    return arithmetic::product<Variance>(consistency_.variance(), constants.extrapolated());
  }

  /// Updates what the scatter of the voltage shows where the model was not identified, while the bank is open.
  template <class Cell, class Constants>
  constexpr void look_at_scatter(const Cell& cell, const Constants& constants, const Voltage& deviation_v) {
    seen_ = {};
    const Fraction outside = constants.extrapolated_in_bank();
    if (!(outside > Fraction(0))) return;
    consistency_.add_scatter(deviation_v, share_);
    seen_ = {arithmetic::product<Variance>(consistency_.scatter_v2(), outside),
             arithmetic::product<Variance>(consistency_.seen_error2(cell.noise.model_v2), outside)};
  }

  /// By how much a SOC is outside of what a cell can have; else <= 0.
  static constexpr Soc beyond_range(const Soc& soc) {
    return Soc(arithmetic::magnitude(Soc(soc - Soc(0.5))) - Soc(0.5 + AmbiguousSoc<S, ModelOf>::capacity_may_be_off));
  }
  constexpr bool is_suspect(const Soc& soc, const Voltage& innovation_v) const {
    return consistency_.is_suspect() || OutlierGate<S>::is_suspect(innovation_v) || beyond_range(soc) > Soc(0);
  }
  /// Flags of an outlier, or of a voltage that shows that the state is inconsistent; else 0.
  template <class Cell>
  constexpr std::uint32_t judge_deviation(const Cell& cell, const StepInput& input, const Soc& soc,
                                          const Voltage& innovation_v, const Variance& of_resistances_v2,
                                          std::uint8_t interval, State& state) {
    const model::OperatingPoint tables{cell, input, Model::mechanism_states(state.model_state)};
    const auto at = look_up(tables, soc, interval);
    const auto h = Model::measurement_jacobian(laws_of(cell), at, input);
    const Variance variance = state.soc_variance();
    const Variance of_soc_v2 =
        arithmetic::product<Variance>(arithmetic::product<Variance>(variance, h[Model::soc]), h[Model::soc]);
    const Variance of_model_v2 =
        Variance(Variance(soc_axis_variance<S>(tables, cell.noise, at, soc, innovation_v, interval) +
                          Errors::model_error_beyond_states(cell.noise)) +
                 Variance(AmbiguousSoc<S, ModelOf>::persistent_variance(cell.noise, state, h) + of_resistances_v2));
    const Variance expected_v2 = Variance(Variance(of_model_v2 + of_soc_v2) + cell.noise.voltage_v2);
    const Soc beyond = beyond_range(soc);
    const bool impossible =
        beyond > Soc(0) &&
        Variance(beyond * beyond) >
            arithmetic::product<Variance>(variance, Count(Consistency<S>::max_sigmas * Consistency<S>::max_sigmas));
    if ((consistency_.is_inconsistent(expected_v2, share_) || impossible) && !judged_by_bank()) {
      estimate_again(soc, variance, of_model_v2, state);
      return soc_ambiguous | soc_contradicted;
    }
    return OutlierGate<S>::is_outlier(innovation_v, expected_v2) ? std::uint32_t{voltage_rejected} : 0;
  }

  /// Opens the bank around the present SOC, with a wider sigma.
  constexpr void estimate_again(const Soc& soc, const Variance& variance, const Variance& of_model_v2, State& state) {
    const Variance wider = arithmetic::product<Variance>(variance, Count(wider_sigma * wider_sigma));
    const auto least = Variance(least_sigma * least_sigma);
    const SocDistribution<S> before{soc, wider < least ? least : wider};
    contradicted_ = true;
    state.covariance.template reset<Model::soc>(before.variance);
    const Variance more_v2 = arithmetic::product<Variance>(of_model_v2, Count(model_error_factor)),
                   seen_v2 = consistency_.variance();
    bank_.open_at(soc, PriorMisfit<S>(before), false, seen_v2 < more_v2 ? seen_v2 : more_v2);
    consistency_.reset();
    consistency_.restart_scatter();
    seen_ = {};
  }

  /// Returns true if the bank has the SOC; false while it only watches.
  template <class Cell, class Constants>
  constexpr bool correct_from_bank(const Cell& cell, const StepInput& input, const Constants& constants, const Soc& soc,
                                   const Voltage& innovation_v, const Variance& of_resistances_v2,
                                   std::uint8_t interval, State& state) {
    const bool watched = bank_.in_background();
    const Voltage deviation_v = Errors::with_error(state, innovation_v);
    look_at_scatter(cell, constants, deviation_v);
    for (int k = constants.bank_points(); k > 0 && bank_.open(); --k)
      bank_.update(cell, input, constants, soc, deviation_v, of_resistances_v2, seen_, interval, state);
    if (watched && !bank_.in_background()) {
      contradicted_ = true;
      consistency_.reset();
    }
    if (!bank_.open() || bank_.in_background()) contradicted_ = false;
    return !watched || !bank_.in_background();
  }

  Consistency<S> consistency_;
  Variance reading_noise_v2_{};
  [[no_unique_address]] typename Errors::LastingLoad load_;
  SeenError<S> seen_;  ///< while the bank is open
  Fraction share_{};   ///< of the last check in the means
  AmbiguousSoc<S, ModelOf> bank_;
  bool contradicted_ = false;
};

}  // namespace bms::estimator
