// Values that depend only on the length of the time step and on the temperature. They are computed when one of these
// changes, not in every step: duration, process noise of the SOC, decay of persistent errors, weights of the voltage.
//
// A voltage reading's own noise is independent from sample to sample; the model's error is not. An error that persists
// for T seconds must count once per T, so at a step dt its variance is multiplied by T / dt (correlated_samples). What
// the temperature does to the resistances, beyond what the cell file knows, lasts as long as the weather.
#pragma once

#include <concepts>
#include <cstdint>

#include "estimator/soc_bank.hpp"
#include "measurement/sample.hpp"
#include "model/extended_rc.hpp"

namespace bms::estimator {

template <class S, class Model, class Errors>
class StepConstants {
  using Soc = arithmetic::Soc<S>;
  using Current = arithmetic::Current<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using Count = arithmetic::Count<S>;
  using Coupling = arithmetic::Coupling<S>;
  using Temperature = arithmetic::Temperature<S>;
  using Factor = arithmetic::Factor<S>;
  using TimeStep = arithmetic::TimeStep<S>;
  using Duration = arithmetic::Duration<S>;

 public:
  /// Range of TimeStep. The RC branch has settled after that.
  static constexpr std::uint32_t longest_step_us = 4'095'000'000U;

  constexpr std::uint64_t step_us() const { return step_us_; }
  constexpr const arithmetic::TimeStep<S>& duration_s() const { return duration_s_; }  ///< longest_step_us at most
  constexpr const Variance& soc_noise() const { return soc_noise_; }                   ///< process noise in a step
  constexpr const Count& correlated_samples() const { return correlated_samples_; }    ///< >= 1
  /// Standard deviation of R0 + R1, relative.
  constexpr const Coupling& resistance_error() const { return resistance_error_; }
  /// Variance of R0 + R1, relative, times the number of samples over which each part of it lasts.
  constexpr const Coupling& resistance_noise() const { return resistance_noise_; }
  /// The parts of its square: what the cell file states, and what a temperature adds that the file does not follow.
  constexpr const Coupling& known_error2() const { return known_error2_; }
  constexpr const Coupling& temperature_error2() const { return temperature_error2_; }
  /// The same as resistance_noise() for an overpotential that relaxes: what the cell file knows, and the temperature.
  constexpr const Coupling& known_noise() const { return known_noise_; }
  constexpr const Coupling& relaxing_noise() const { return relaxing_noise_; }
  /// What the overpotential is wrong by outside of the temperatures of the identification, over what it is wrong by
  /// inside of them; 1 at most. 0 of a cell file that does not follow the temperature.
  constexpr const Fraction& extrapolated() const { return extrapolated_; }
  /// The same for a bank, which has no other way to see it. Of a cell file that does not follow the temperature: what
  /// an overpotential may be wrong by over itself; 1 at most.
  constexpr Fraction extrapolated_in_bank() const {
    if (extrapolated_ > Fraction(0)) return extrapolated_;
    const Coupling error = extrapolation_error();
    return error < Coupling(1) ? arithmetic::ratio<Fraction>(Variance(error), Variance(1)) : Fraction(1);
  }
  /// What the temperature adds to the relative error of the overpotential outside of those of the identification.
  constexpr Coupling extrapolation_error() const {
    return extrapolated_ > Fraction(0) ? beyond_range_ : Coupling(resistance_error_ - known_error_);
  }
  constexpr const Fraction& bank_share() const { return bank_share_; }  ///< for SocBank::step
  /// Points of the bank that a sample updates: as many as pass in its time at rows of one to two seconds.
  constexpr int bank_points() const { return bank_points_; }
  constexpr const typename Model::OptionalErrorDecay& error_decay() const { return error_decay_; }

  static constexpr std::uint32_t capped(std::uint64_t step_us) {
    return step_us < longest_step_us ? static_cast<std::uint32_t>(step_us) : longest_step_us;
  }

  constexpr void set_time_step(const model::FilterNoise<S>& noise, std::uint64_t step_us) {
    step_us_ = step_us;
    duration_s_ = arithmetic::seconds<S>(capped(step_us));
    const auto correlated_samples = arithmetic::ratio<Count>(noise.model_correlation_s, duration_s_);
    correlated_samples_ = correlated_samples > Count(1) ? correlated_samples : Count(1);
    update_resistance_noise();
    bank_points_ = 1;
    for (std::uint32_t us = capped(step_us) / 2; us >= 1'000'000 && bank_points_ < 2 * SocBank<S>::points; us /= 2)
      bank_points_ = static_cast<std::uint8_t>(2 * bank_points_);
    const int turn = 2 * SocBank<S>::points / bank_points_;  // samples
    bank_share_ = correlated_samples > Count(turn) * Fraction(0.5)
                      ? arithmetic::ratio<Fraction>(Count(turn), correlated_samples)
                      : Fraction(SocBank<S>::max_share);
    const Soc white = accumulated_soc(noise.white_soc_per_s);
    soc_noise_ = Errors::soc_noise(Variance(white * white), noise, duration_s_);
    error_decay_ = Model::error_decay(noise, duration_s_);
  }

  /// Outside of the temperatures of the identification the overpotential is less certain. Resistances are also larger
  /// in the cold, and smaller in the warm, than a cell file says that does not follow the temperature: the filter adds
  /// that difference (model::assumed_activation_j_per_mol).
  template <class Cell>
  constexpr void set_temperature(const Cell& cell, std::int16_t cdegc) {
    known_error_ = Coupling(cell.noise.resistance_error);
    Coupling unknown(0);
    extrapolated_ = Fraction(0);
    if (measurement::temperature_possible(cdegc)) {
      const auto c = arithmetic::from_centi<Temperature>(cdegc);
      if (laws_of(cell).resistances_follow_temperature()) {
        const Coupling more = extrapolation_error(cell.noise.identified, cdegc, c);
        if (more > Coupling(0))
          extrapolated_ =
              more < known_error_ ? arithmetic::ratio<Fraction>(Variance(more), Variance(known_error_)) : Fraction(1);
        known_error_ = Coupling(known_error_ + more);
        beyond_range_ = more;
      } else if (cdegc != cell.reference.cdegc)
        unknown = arithmetic::magnitude(Coupling(
            model::mechanism_detail::arrhenius<S>(cell.reference.energy_over_rt, cell.reference.c, c) - Factor(1)));
    }
    resistance_error_ = Coupling(known_error_ + unknown);
    update_resistance_noise();
  }

  /// Samples in a time, or in the correlation time of the model's error if that is longer.
  constexpr Count samples_in(const Duration& time_s) const {
    const auto count = arithmetic::ratio<Count>(time_s, duration_s_);
    return count > correlated_samples_ ? count : correlated_samples_;
  }

  /// SOC by which the charge of a step may be wrong when the current was not measured: an unknown current flowed, and
  /// the current that was counted instead may have ended. 1 at most.
  template <class Cell>
  constexpr Soc unknown_charge(const Cell& cell, const Current& counted_a) const {
    return accumulated_soc(
        Soc(cell.noise.unknown_soc_per_s + arithmetic::magnitude(Soc(counted_a * cell.limits.soc_per_as))));
  }
  /// SOC by which a current, >= 0, moves the cell in a step of longest_step_us at most; 1 at most.
  template <class Cell>
  constexpr Soc charge_of(const Cell& cell, const Current& current_a) const {
    const Soc most(1), moved = Soc(current_a * cell.limits.soc_per_as) * duration_s_;
    return moved < most ? moved : most;
  }

 private:
  /// Relative error of the overpotential: tolerance.resistance_per_ev times |1 / kT - 1 / kT_edge|.
  static constexpr Coupling extrapolation_error(const model::IdentifiedTemperatures<S>& identified, std::int16_t cdegc,
                                                const Temperature& c) {
    const bool colder = cdegc<identified.min_cdegc, hotter = cdegc> identified.max_cdegc;
    if (!colder && !hotter) return Coupling(0);
    const Temperature kelvin = c + Temperature(273.15);
    const Temperature beyond = colder ? Temperature(identified.min_c - c) : Temperature(c - identified.max_c);
    return Coupling(
        Factor((colder ? identified.per_colder : identified.per_hotter) * arithmetic::ratio<Fraction>(beyond, kelvin)));
  }

  constexpr void update_resistance_noise() {
    known_error2_ = Coupling(known_error_ * known_error_);
    known_noise_ = arithmetic::product<Coupling>(known_error2_, correlated_samples_);
    // both have one sign for all loads, so standard deviations add: (k + t)^2 - k^2 is what t adds
    temperature_error2_ =
        Coupling(Coupling(resistance_error_ - known_error_) * Coupling(resistance_error_ + known_error_));
    const Coupling by_temperature =
        arithmetic::product<Coupling>(temperature_error2_, samples_in(Duration(Errors::temperature_lasts_s)));
    resistance_noise_ = Coupling(known_noise_ + by_temperature);
    relaxing_noise_ =
        arithmetic::product<Coupling>(temperature_error2_, samples_in(Duration(Errors::relaxation_lasts_s)));
  }

  /// Sum over the step of a rate per second, 1 at most.
  constexpr Soc accumulated_soc(const Soc& per_s) const {
    const Soc most(1), once = per_s * duration_s_;
    Soc sum = once;
    for (std::uint64_t left_us = step_us_; left_us > longest_step_us && sum < most; left_us -= longest_step_us)
      sum += once;
    return sum < most ? sum : most;
  }

  std::uint64_t step_us_ = 0;
  arithmetic::TimeStep<S> duration_s_{};
  Variance soc_noise_{};
  Count correlated_samples_{1};
  Coupling resistance_error_{}, resistance_noise_{};
  Fraction bank_share_{}, extrapolated_{};
  std::uint8_t bank_points_ = 1;
  [[no_unique_address]] typename Model::OptionalErrorDecay error_decay_{};
  Coupling beyond_range_{};  ///< what a temperature outside of the identification adds to known_error_
  Coupling known_error_{}, known_error2_{}, temperature_error2_{}, known_noise_{}, relaxing_noise_{};
};

}  // namespace bms::estimator
