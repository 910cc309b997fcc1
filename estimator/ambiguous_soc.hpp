// The state of charge while more than one value fits the voltages: connects the bank of hypotheses (soc_bank.hpp) to
// the state of the filter. While the bank is open, it corrects the SOC; the other states follow the prediction.
//
// Resistances depend on the SOC, in the cold by a factor of ten: a polarisation that was predicted at one SOC is scaled
// to that of each hypothesis. Otherwise a wrong SOC near empty would explain itself by its own large resistance.
// The error of a polarisation relaxes within its time constant, so it is noise; that of the other states is a bias.
//
// A turn of the bank takes 128 samples, and keeps the first one with the state of the filter at it. Were each
// hypothesis compared on the sample of its turn, then one whose sample is wrong, because the load stepped between the
// current and the voltage, would be ruled out by that: loads of 1.4 C that come and go made a start err by 9 sigma.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "estimator/cell_state.hpp"
#include "estimator/persistent_errors.hpp"
#include "estimator/soc_bank.hpp"
#include "estimator/start.hpp"
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
  /// How far outside of 0 to 1 a SOC can get by an error of the capacity alone.
  static constexpr double capacity_may_be_off = 0.05;

  constexpr bool open() const { return bank_.open(); }
  /// The bank only watches: the filter goes on until its state is contradicted.
  constexpr bool in_background() const { return in_background_; }

  /// Starts the bank. mean: SOC of the filter; deviation_v2: variance of the voltage's error that the last half hour
  /// showed.
  constexpr void open_at(const Soc& mean, const PriorMisfit<S>& prior, bool in_background = false,
                         const Variance& deviation_v2 = Variance{}) {
    bank_.clear_first_misfits();
    open_after_voltage(mean, prior, in_background);
    deviation_v2_ = deviation_v2;
  }
  /// The same after a first voltage, whose misfits the bank has.
  [[gnu::cold, gnu::noinline]] constexpr void open_after_voltage(const Soc& mean, const PriorMisfit<S>& prior,
                                                                 bool in_background) {
    in_background_ = in_background;
    deviation_v2_ = Variance{};
    bank_.open_at(mean,
                  [&](int k) { return arithmetic::Exponent<S>(bank_.first_misfit(k) + prior(SocBank<S>::grid(k))); });
  }
  constexpr SocBank<S>& hypotheses() { return bank_; }

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
      open_at(soc, PriorMisfit<S>(), false, deviation_v2_);
    }
    const auto operating_point = [&](const model::StepInput<S>& at_input, const ModelState& x) {
      return model::OperatingPoint{cell, at_input, Model::mechanism_states(x)};
    };
    const auto now = operating_point(input, state.model_state);
    if (bank_.begins_turn())
      read(cell, input, constants, look_up(now, soc, interval), deviation_v, drop_v2, seen, state);
    const auto observation = [&](const Soc& on_grid) -> typename SocBank<S>::Observation {
      const Soc there = possible(on_grid);
      const auto tables = operating_point(reading_.input, reading_.model_state);
      const auto at = look_up(tables, there, interval);
      const auto polarised = Model::polarisation_at(reading_.model_state, reading_.at_1c_v,
                                                    at_1c_v(cell, reading_.input, reading_.model_state, at));
      const Voltage off_v = Voltage(reading_.voltage_v - Model::voltage(laws_of(cell), polarised, at, reading_.input));
      const Variance axis_v2 = soc_axis_variance<S>(tables, cell.noise, at, there, off_v, interval);
      return {.off_v = off_v,
              .half_v = Voltage(ocv_slope<S>(at) * half_step()),
              .new_v2 = reading_.new_v2,
              .axis_v2 = arithmetic::product<Variance>(axis_v2, uncorrelated()),
              .persistent_v2 = Variance(reading_.persistent_v2 + axis_v2)};
    };
    const auto result =
        bank_.step(soc, constants.bank_share(), cell.noise.voltage_v2, reading_.lasting_v2, observation);
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
    const auto at_1c = [&](const Soc& at_soc) {
      return at_1c_v(cell, input, state.model_state, look_up(now, at_soc, interval));
    };
    state.model_state = Model::polarisation_at(state.model_state, at_1c(soc), at_1c(moved));
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
  using ModelState = typename Model::State;
  using Voltages = decltype(Model::final_voltages(std::declval<const model::LawSet<S>&>(), ModelState{}, {}, {}));

  /// What the hypotheses of a turn are compared on: a sample, and the state of the filter then.
  struct Reading {
    model::StepInput<S> input{};
    ModelState model_state{};
    Voltages at_1c_v{};   ///< final voltages at 1C, at the SOC of the filter
    Voltage voltage_v{};  ///< without the estimated voltage error
    Variance new_v2{}, persistent_v2{}, lasting_v2{};
  };

  /// Final voltages at 1C.
  template <class Cell>
  static constexpr Voltages at_1c_v(const Cell& cell, const model::StepInput<S>& input, const ModelState& x,
                                    const model::TablePoint<S>& at) {
    return Model::final_voltages(laws_of(cell), x, at, {cell.noise.one_c_a, input.duration_s, input.temperature_c});
  }

  /// Takes a sample as the reading of a turn. middle: of the tables at the SOC of the filter.
  template <class Cell, class Constants>
  constexpr void read(const Cell& cell, const model::StepInput<S>& input, const Constants& constants,
                      const model::TablePoint<S>& middle, const Voltage& deviation_v, const Variance& drop_v2,
                      const SeenError<S>& seen, const State& state) {
    const auto& laws = laws_of(cell);
    const auto h = Model::measurement_jacobian(laws, middle, input);
    const auto states_v2 = state.covariance.variances();
    const Variance relaxing_v2 =
        sum_variance<Model>(states_v2, h, [&](std::size_t k) { return Model::is_polarisation(laws, k); });
    const Variance states_lasting_v2 = sum_variance<Model>(states_v2, h, [&](std::size_t k) {
      return !Model::is_polarisation(laws, k) && !(Model::errors_are_states && k == Model::voltage_error);
    });
    const Variance lasting_v2 = Variance(cell.noise.model_v2 + states_lasting_v2);
    const Voltages middle_v = at_1c_v(cell, input, state.model_state, middle);
    reading_ = {
        .input = input,
        .model_state = state.model_state,
        .at_1c_v = middle_v,
        .voltage_v = Voltage(deviation_v + Model::voltage(laws, state.model_state, middle, input)),
        .new_v2 = Variance(arithmetic::product<Variance>(Variance(cell.noise.model_v2 + drop_v2), uncorrelated()) +
                           Variance(relaxing_v2 + seen.scatter_v2)),
        .persistent_v2 = Variance(Variance(lasting_v2 + Variance(drop_v2 + deviation_v2_)) +
                                  unidentified_v2(cell, middle, middle_v, constants, seen)),
        .lasting_v2 = lasting_v2};
  }

  /// Variance of a model that is used at another temperature than it was identified at: its scatter, and what the error
  /// of the overpotential makes of a load before the half hour that was seen. left_v: what 1C would leave.
  template <class Cell, class Constants>
  static constexpr Variance unidentified_v2(const Cell& cell, const model::TablePoint<S>& at, const Voltages& left_v,
                                            const Constants& constants, const SeenError<S>& seen) {
    if (!(constants.extrapolated_in_bank() > Fraction(0))) return Variance{};
    Variance sum = Variance(Variance(Voltage(at.r0_ohm * cell.noise.one_c_a)) + Variance(left_v[0]));
    for (std::size_t k = 1; k < left_v.size(); ++k) {
      if (Model::is_polarisation(laws_of(cell), Model::first_voltage + k - 1))
        sum = Variance(sum + Variance(left_v[k]));
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
  /// A hypothesis that the counted charge has moved further than that has the voltages of that SOC.
  static constexpr Soc possible(const Soc& soc) {
    const auto least = Soc(-capacity_may_be_off), most = Soc(1 + capacity_may_be_off);
    if (soc < least) return least;
    return soc > most ? most : soc;
  }
  static constexpr Fraction uncorrelated() { return Fraction(uncorrelated_share); }
  static constexpr Fraction half_step() { return Fraction(0.5 / SocBank<S>::points); }

  SocBank<S> bank_;
  Reading reading_;
  Variance deviation_v2_{};
  bool in_background_ = false;
};

}  // namespace bms::estimator
