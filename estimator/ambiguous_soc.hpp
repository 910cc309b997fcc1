// The state of charge while more than one value fits the voltages: connects the bank of hypotheses (soc_bank.hpp) to
// the state of the filter. While the bank is open, it corrects the SOC; the other states follow the prediction.
//
// Resistances depend on the SOC, in the cold by a factor of ten: a polarisation that was predicted at one SOC is scaled
// to that of each hypothesis. Otherwise a wrong SOC near empty would explain itself by its own large resistance.
// The error of a polarisation relaxes within its time constant, so it is noise; that of the other states is a bias.
#pragma once

#include <cstddef>
#include <cstdint>

#include "estimator/cell_state.hpp"
#include "estimator/persistent_errors.hpp"
#include "estimator/soc_bank.hpp"
#include "estimator/step_constants.hpp"
#include "estimator/voltage_uncertainty.hpp"

namespace bms::estimator {

/// What the last half hour showed of a model that is used at another temperature than it was identified at.
template <class S>
struct SeenError {
  arithmetic::Variance<S> scatter_v2{};      ///< of the voltage about its mean deviation
  arithmetic::Variance<S> overpotential2{};  ///< square of the relative error of the overpotential
};

/// What a sample changed.
enum class BankEvent : std::uint8_t { none, estimated };

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
  /// Probability that the SOC is elsewhere (SocBank::apart_soc), from which the bank replaces the state of the filter.
  /// The misfit of the best hypothesis alone would not do: a given start has one place, the others share theirs.
  /// A start and all other SOCs have even odds before any voltage; the voltages have to change them to e to 1.
  static constexpr double replaces_above = 0.731;
  /// The bank watches until all SOCs this far away have a misfit of that much more: e^9 to 1.
  static constexpr double watches_beyond = 0.1, closes_above = 9;

  constexpr bool open() const { return bank_.open(); }
  /// The bank only watches: the filter goes on until its state is contradicted.
  constexpr bool in_background() const { return in_background_; }

  /// Starts the bank. mean: SOC of the filter; misfit(soc, half a step of the grid, interval): >= 0; deviation_v2:
  /// variance of the voltage's error that the last half hour showed.
  template <class Misfit>
  constexpr void open_at(const Soc& mean, const Misfit& misfit, bool in_background = false,
                         const Variance& deviation_v2 = Variance{}) {
    std::uint8_t interval = 0;
    in_background_ = in_background;
    deviation_v2_ = deviation_v2;
    bank_.open_at(mean, [&](const Soc& soc) { return misfit(soc, half_step(), interval); });
  }

  /// The filter corrected its SOC by `by` while the bank watches.
  constexpr void follow(const Soc& by) { bank_.follow(by); }

  /// One sample: updates the bank and, when it has a result, the SOC of the state. soc: predicted; deviation_v: of the
  /// reading from the model without the estimated voltage error, which belongs to the filter's SOC; interval: of soc.
  template <class Cell, class Constants>
  constexpr BankEvent update(const Cell& cell, const model::StepInput<S>& input, const Constants& constants,
                             const Soc& soc, const Voltage& deviation_v, const Variance& drop_v2,
                             const SeenError<S>& seen, std::uint8_t interval, State& state) {
    if (bank_.has_run_off(soc)) {  // by an offset of the current: it begins again, or stops to watch
      if (in_background_) {
        bank_.close();
        return BankEvent::none;
      }
      bank_.open_at(soc, [](const Soc&) { return arithmetic::Exponent<S>(0); });
    }
    const auto& laws = laws_of(cell);
    const model::OperatingPoint operating_point{cell, input, Model::mechanism_states(state.model_state)};
    const auto middle = look_up(operating_point, soc, interval);
    const model::StepInput<S> reference{cell.noise.one_c_a, input.duration_s, input.temperature_c};
    const auto final_v = [&](const auto& at) { return Model::final_voltages(laws, state.model_state, at, reference); };
    const auto middle_v = final_v(middle);
    const Voltage expected_v = Model::voltage(laws, state.model_state, middle, input);
    const auto h = Model::measurement_jacobian(laws, middle, input);
    const auto states_v2 = state.covariance.variances();
    const Variance relaxing_v2 =
        sum_variance<Model>(states_v2, h, [&](std::size_t k) { return Model::is_polarisation(laws, k); });
    const Variance lasting_v2 = sum_variance<Model>(states_v2, h, [&](std::size_t k) {
      return !Model::is_polarisation(laws, k) && !(Model::errors_are_states && k == Model::voltage_error);
    });
    const Variance new_v2 =
        Variance(arithmetic::product<Variance>(Variance(cell.noise.model_v2 + drop_v2), uncorrelated()) +
                 Variance(relaxing_v2 + seen.scatter_v2));
    const Variance persistent_v2 =
        Variance(Variance(Variance(cell.noise.model_v2 + lasting_v2) + Variance(drop_v2 + deviation_v2_)) +
                 unidentified_v2(cell, laws, middle, middle_v, constants, seen));
    const auto observation = [&](const Soc& there) -> typename SocBank<S>::Observation {
      const auto at = look_up(operating_point, there, interval);
      const auto polarised = Model::polarisation_at(state.model_state, middle_v, final_v(at));
      const Voltage off_v = Voltage(deviation_v + (expected_v - Model::voltage(laws, polarised, at, input)));
      const Variance axis_v2 = soc_axis_variance<S>(operating_point, cell.noise, at, there, off_v);
      return {.off_v = off_v,
              .half_v = Voltage(ocv_slope<S>(at) * half_step()),
              .new_v2 = new_v2,
              .axis_v2 = arithmetic::product<Variance>(axis_v2, uncorrelated()),
              .persistent_v2 = Variance(persistent_v2 + axis_v2)};
    };
    const auto result = bank_.step(soc, constants.bank_share(), cell.noise.voltage_v2,
                                   Variance(cell.noise.model_v2 + lasting_v2), observation);
    if (!result.ready) return BankEvent::none;
    deviation_v2_ = Variance(
        deviation_v2_ - arithmetic::product<Variance>(deviation_v2_, SocBank<S>::decay_in(constants.bank_share())));
    const Soc moved = Soc(soc + result.moved);
    if (in_background_ && !(result.elsewhere > Fraction(replaces_above))) {
      close_if_decided(soc, moved);
      bank_.follow(Soc(-result.moved));
      return BankEvent::none;
    }
    state.charge.correct(result.moved, cell.charge);
    const auto there = look_up(operating_point, moved, interval);
    state.model_state = Model::polarisation_at(state.model_state, middle_v, final_v(there));
    state.covariance.template reset<Model::soc>(result.variance);
    in_background_ = result.variance < Variance(SocBank<S>::close_below_sigma * SocBank<S>::close_below_sigma);
    if (in_background_) close_if_decided(moved, moved);
    return BankEvent::estimated;
  }

  /// Variance of the voltage errors that persist while the bank is open: the model's, and those of the states that are
  /// not corrected then. h: measurement Jacobian.
  static constexpr Variance persistent_variance(const model::FilterNoise<S>& noise, const State& state,
                                                const typename Model::MeasurementJacobian& h) {
    return Variance(Errors::model_error_in_bank(noise) +
                    sum_variance<Model>(state.covariance.variances(), h, [](std::size_t) { return true; }));
  }

 private:
  /// Variance of a model that is used at another temperature than it was identified at: its scatter, and what the error
  /// of the overpotential makes of a load before the half hour that was seen. at_1c_v: what 1C would leave.
  template <class Cell, class Laws, class FinalVoltages, class Constants>
  static constexpr Variance unidentified_v2(const Cell& cell, const Laws& laws, const model::TablePoint<S>& at,
                                            const FinalVoltages& at_1c_v, const Constants& constants,
                                            const SeenError<S>& seen) {
    if (!(constants.extrapolated_in_bank() > Fraction(0))) return Variance{};
    Variance sum = Variance(Variance(Voltage(at.r0_ohm * cell.noise.one_c_a)) + Variance(at_1c_v[0]));
    for (std::size_t k = 1; k < at_1c_v.size(); ++k) {
      if (Model::is_polarisation(laws, Model::first_voltage + k - 1)) sum = Variance(sum + Variance(at_1c_v[k]));
    }
    const Variance left = Variance(
                       sum * arithmetic::ratio<Variance>(Variance(cell.noise.unknown_a), Variance(cell.noise.one_c_a))),
                   stated2 = Variance(constants.extrapolation_error() * constants.extrapolation_error());
    return Variance(seen.scatter_v2 +
                    Variance(Variance(left * left) * (seen.overpotential2 < stated2 ? stated2 : seen.overpotential2)));
  }

  constexpr void close_if_decided(const Soc& soc, const Soc& filter_soc) {
    if (bank_.rules_out_beyond(Soc(watches_beyond), arithmetic::Current<S>(closes_above), soc, filter_soc))
      bank_.close();
  }
  static constexpr Fraction uncorrelated() { return Fraction(uncorrelated_share); }
  static constexpr Fraction half_step() { return Fraction(0.5 / SocBank<S>::points); }

  SocBank<S> bank_;
  Variance deviation_v2_{};
  bool in_background_ = false;
};

}  // namespace bms::estimator
