// State of charge of one cell: an extended Kalman filter over a cell model's states, one sample in, one estimate out.
//
//   predict   charge counted in integers, other states by the model's exact step, covariance by its analytic transition
//   correct   by the voltage, if it may be believed; otherwise the prediction stands and sigma grows
//
// One body for every scalar and for the 1RC model with any mechanisms (model/extended_rc.hpp: N states). The laws of
// the mechanisms come with the cell; where it has none, nothing of them is left. No heap, no exceptions, no libm but
// sqrt, no clock: the same samples give the same bits on every core (float and fixed point; compile with
// -ffp-contract=off).
//
// Voltage noise: a reading's own noise is new in every sample, the model's error is not. One that lasts for T seconds
// counts once per T: at a step dt its variance is taken T / dt times. It is larger where the OCV is steep (the soc axis
// of its table is good to tolerance.initial_soc) and under current (R0 and R1 are good to
// tolerance.resistance_fraction).
//
// While soc is not known to 3 %, a bank of hypotheses keeps it (soc_bank.hpp): a line through the OCV curve would be
// sure of one.
//
// Memory: CellState<float> 24 bytes a cell; the rest is shared or guards inputs. Cost in instructions:
// estimator/README.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/charge.hpp"
#include "estimator/current_at_rest.hpp"
#include "estimator/estimate.hpp"
#include "estimator/input_check.hpp"
#include "estimator/soc_bank.hpp"
#include "estimator/start.hpp"
#include "estimator/ud_covariance.hpp"
#include "estimator/voltage_uncertainty.hpp"
#include "measurement/sample.hpp"
#include "model/extended_rc.hpp"
#include "model/fixed_ranges.hpp"

namespace bms::estimator {

/// What is remembered of one cell from sample to sample.
template <class S, template <class> class Model>
struct CellState {
  Charge<S> charge;
  UdCovariance<S, Model<S>::states> covariance;
  typename Model<S>::State model_state{};
};

template <class S, template <class> class ModelOf = model::ExtendedRc<0, 0>::Of>
class SocEstimator {
 public:
  using Model = ModelOf<S>;
  using Scalar = S;
  static constexpr std::size_t states = Model::states;
  static constexpr std::size_t extra_values = Model::values - 1 + (Model::errors_are_states ? 1 : 0);
  using Result = std::conditional_t<extra_values == 0, Estimate<S>, ExtendedEstimate<S, extra_values>>;

  constexpr SocEstimator() = default;

  /// Begins at a known state of charge instead of one read from the first voltage.
  constexpr explicit SocEstimator(const measurement::StartingPoint& from) : from_{from}, has_start_{true} {}

  /// The only call. cell: prepared for S, the same in every call.
  template <class Cell>
  constexpr Result step(const Cell& cell, const measurement::Sample& sample) {
    if (!started_) return start(cell, sample);
    if (sample.time_us <= time_us_) return repeated_estimate(cell, time_not_increasing);

    std::uint32_t flags = 0;
    const std::uint64_t step_us = sample.time_us - time_us_;
    time_us_ = sample.time_us;
    const AcceptedCurrent current = check_.current(sample.current_ua, cell.plausible, flags);
    if (step_us != step_us_) set_time_step(cell, step_us, flags);
    if (sample.temperature_cdegc >> 8 != temperature_bin_) [[unlikely]]
      update_temperature(cell, sample.temperature_cdegc);
    const auto& laws = laws_of(cell);
    const StepInput input{laws.true_current(Model::without_offset(arithmetic::from_micro<Current>(current.ua),
                                                                  state_.model_state, cell.noise)),
                          duration_s_, temperature(laws, sample)};
    count_charge(cell, counted_ua(laws, input, current.ua), step_us);

    const Soc soc = state_.charge.soc(cell.charge);
    const auto at =
        look_up(model::OperatingPoint{cell, input, Model::mechanism_states(state_.model_state)}, soc, interval_);
    const auto discretisation = Model::discretise(laws, state_.model_state, at, input, error_decay_);

    auto noise = Model::noise(laws, discretisation, cell.noise);
    noise[Model::soc] = soc_noise_;
    if ((flags & (time_gap | current_missing | current_implausible)) != 0) [[unlikely]] {
      const bool measured = (flags & (current_missing | current_implausible)) == 0;
      noise[Model::soc] = Variance(soc_noise_ + unknown_charge_variance(cell, measured ? Current(0) : input.current_a));
      if (!measured) {  // what drops over the resistances is not known then
        const Voltage unknown_v =
            steady_state_drop_v<S>(at, Current(arithmetic::magnitude(input.current_a) + cell.noise.unknown_a));
        noise[0] = Variance(noise[0] + unknown_v * unknown_v);
      }
    }
    if constexpr (Model::errors_are_states)
      noise[Model::soc] =
          Variance(noise[Model::soc] + gain_error_variance(Soc(soc - since_anchor_.soc), cell.noise.gain));
    state_.covariance.propagate(Model::state_transition(state_.model_state, at, discretisation, input), noise);
    state_.model_state = Model::advance(state_.model_state, at, discretisation, input);

    const Voltage predicted_v = Model::voltage(laws, state_.model_state, at, input);
    if constexpr (Model::errors_are_states) update_offset_at_rest(cell, current, step_us);
    if (check_.voltage_usable(sample.voltage_uv, Voltage(at.r0_ohm * input.current_a), cell.plausible, flags)) {
      const Voltage innovation_v = arithmetic::from_micro<Voltage>(sample.voltage_uv) - predicted_v;
      correct(cell, at, input, soc, innovation_v, flags);
    }
    Result estimate;
    estimate.voltage_predicted_v = predicted_v;
    estimate.flags = flags;
    fill_state(cell, estimate);
    if constexpr (Model::errors_are_states) bound_gain_error(estimate.soc, estimate.soc_sigma, cell.noise.gain);
    return estimate;
  }

  constexpr const CellState<S, ModelOf>& state() const { return state_; }
  /// Of the last sample that was taken.
  constexpr std::uint64_t time_us() const { return time_us_; }

 private:
  using StepInput = model::StepInput<S>;
  using Soc = arithmetic::Soc<S>;
  using Voltage = arithmetic::Voltage<S>;
  using Current = arithmetic::Current<S>;
  using Variance = arithmetic::Variance<S>;
  using Fraction = arithmetic::Fraction<S>;
  using TimeStep = arithmetic::TimeStep<S>;
  using Count = arithmetic::Count<S>;
  using Coupling = arithmetic::Coupling<S>;

  static constexpr std::uint32_t longest_step_us =
      4'095'000'000U;  // TimeStep's range; the RC branch has settled after that
  static constexpr std::int16_t reference_cdegc = 2'500;
  static constexpr int longest_gap_counts = 1'000;  // 23 days; nothing is known after that

  /// Current that ends as charge. Without a law that makes another of it, the reading itself.
  template <class Laws>
  static constexpr std::int32_t counted_ua(const Laws& laws, const StepInput& input, std::int32_t read_ua) {
    return Model::errors_are_states || laws.changes_charge() ? arithmetic::to_micro(laws.counted(input)) : read_ua;
  }

  /// The last one that can be, 25 degrees C at first.
  template <class Laws>
  constexpr arithmetic::Temperature<S> temperature(const Laws& laws, const measurement::Sample& sample) {
    if constexpr (std::same_as<Laws, model::LawSet<S>>) return arithmetic::Temperature<S>(25);  // nobody asks
    if (measurement::temperature_possible(sample.temperature_cdegc)) temperature_cdegc_ = sample.temperature_cdegc;
    return laws.true_temperature(arithmetic::from_centi<arithmetic::Temperature<S>>(temperature_cdegc_));
  }

  template <class Cell>
  constexpr void count_charge(const Cell& cell, std::int32_t current_ua, std::uint64_t step_us) {
    if (step_us > longest_count_us) [[unlikely]] {
      for (int counts = 0; step_us > longest_count_us && counts < longest_gap_counts; ++counts) {
        state_.charge.count(current_ua, longest_count_us, cell.charge);
        step_us -= longest_count_us;
      }
      if (step_us > longest_count_us) step_us = longest_count_us;
    }
    state_.charge.count(current_ua, static_cast<std::uint32_t>(step_us), cell.charge);
  }

  /// What depends on the step's length alone is computed when the length changes.
  template <class Cell>
  [[gnu::noinline]] constexpr void set_time_step(const Cell& cell, std::uint64_t step_us, std::uint32_t& flags) {
    step_us_ = step_us;
    const std::uint32_t capped_us = step_us < longest_step_us ? static_cast<std::uint32_t>(step_us) : longest_step_us;
    check_.gap(capped_us, flags);
    duration_s_ = arithmetic::seconds<S>(capped_us);
    const model::FilterNoise<S>& n = cell.noise;
    const auto correlated_samples = arithmetic::ratio<arithmetic::Count<S>>(n.model_correlation_s, duration_s_);
    correlated_samples_ = correlated_samples > arithmetic::Count<S>(1) ? correlated_samples : arithmetic::Count<S>(1);
    update_resistance_noise();
    const auto most = Fraction(1.9);
    bank_share_ = correlated_samples > arithmetic::Count<S>(SocBank<S>::points)
                      ? arithmetic::ratio<Fraction>(arithmetic::Count<S>(2 * SocBank<S>::points), correlated_samples)
                      : most;
    const Soc white = accumulated_soc(n.white_soc_per_s);
    soc_noise_ = Variance(white * white);
    if constexpr (!Model::errors_are_states)
      soc_noise_ = soc_noise_ + arithmetic::product<Variance>(n.walk_soc2_per_s, duration_s_);
    error_decay_ = Model::error_decay(n, duration_s_);
  }

  /// Every 2.56 K anew: in the cold, resistances are larger than a file says that does not follow the temperature, by
  /// some 40 kJ/mol (lithium iron phosphate, 30 to 60); by so much they are doubted.
  template <class Cell>
  [[gnu::noinline]] constexpr void update_temperature(const Cell& cell, std::int16_t cdegc) {
    temperature_bin_ = static_cast<std::int16_t>(cdegc >> 8);
    resistance_error_ = Coupling(cell.noise.resistance_error);
    if (measurement::temperature_possible(cdegc) && cdegc < reference_cdegc &&
        !laws_of(cell).resistances_follow_temperature()) {
      constexpr double usual = model::mechanism_detail::energy_over_rt(40'000.0, 25.0);
      const auto factor =
          model::mechanism_detail::arrhenius<S>(arithmetic::Factor<S>(usual), arithmetic::Temperature<S>(25),
                                                arithmetic::from_centi<arithmetic::Temperature<S>>(cdegc));
      resistance_error_ = Coupling(resistance_error_ + Coupling(factor - arithmetic::Factor<S>(1)));
    }
    update_resistance_noise();
  }
  constexpr void update_resistance_noise() {
    resistance_noise_ =
        arithmetic::product<Coupling>(Coupling(resistance_error_ * resistance_error_), correlated_samples_);
  }

  /// What adds up to by the end of the step, 1 at most.
  constexpr Soc accumulated_soc(const Soc& per_s) const {
    const Soc most(1), once = per_s * duration_s_;
    Soc sum = once;
    for (std::uint64_t left_us = step_us_; left_us > longest_step_us && sum < most; left_us -= longest_step_us)
      sum += once;
    return sum < most ? sum : most;
  }

  /// Variance to add when the charge of a step may be wrong by a current that nobody measured, and what was counted
  /// instead may have ceased. Such an error goes on in the same direction, so standard deviations add: (sigma + d)^2 -
  /// sigma^2.
  template <class Cell>
  constexpr Variance unknown_charge_variance(const Cell& cell, const Current& counted_a) const {
    const Soc d = accumulated_soc(
        Soc(cell.noise.unknown_soc_per_s + arithmetic::magnitude(Soc(counted_a * cell.limits.soc_per_as))));
    const Soc sigma = arithmetic::root<Soc>(state_.covariance.template variance<Model::soc>());
    return Variance(d * d) + Variance((sigma + sigma) * d);
  }

  using Correction = std::array<Voltage, states>;

  constexpr void apply_correction(const Correction& correction, const model::ChargeScale<S>& scale) {
#pragma GCC unroll 8
    for (std::size_t i = 0; i < states; ++i) {
      if (i != Model::soc) state_.model_state[Model::value_index(i)] += correction[i];
    }
    state_.charge.correct(correction[Model::soc], scale);
  }

  /// A current that rests is the sensor's offset, but for what the cell file says may flow then.
  template <class Cell>
  constexpr void update_offset_at_rest(const Cell& cell, const AcceptedCurrent& current, std::uint64_t step_us) {
    if (!(cell.noise.at_rest_per_h2 > Variance(0))) return;
    if (!current.measured) return at_rest_.reset();
    if (!at_rest_.is_at_rest(current.ua, step_us, cell.noise.at_rest)) return;
    const auto correlated_samples =
        arithmetic::ratio<Count>(arithmetic::Duration<S>(static_cast<int>(CurrentAtRest::correlation_s)), duration_s_);
    const Voltage read = arithmetic::ratio<Voltage>(arithmetic::from_micro<Current>(current.ua), cell.noise.one_c_a);
    typename Model::MeasurementJacobian h{};
    h[Model::last] = arithmetic::VoltagePerSoc<S>(1);
    const Variance noise = arithmetic::product<Variance>(cell.noise.at_rest_per_h2,
                                                         correlated_samples > Count(1) ? correlated_samples : Count(1));
    apply_correction(state_.covariance.observe(h, noise, Voltage(read - state_.model_state[Model::current_offset])),
                     cell.charge);
  }

  /// What a wrong gain makes of the charge that was counted since soc was last known, c: its standard deviation is gain
  /// c, so a step's part of the variance is gain^2 ((c + d)^2 - c^2). Charge that comes back takes it away again, which
  /// a covariance cannot: then it stays.
  constexpr Variance gain_error_variance(const Soc& d, const Fraction& gain) {
    const Soc before = since_anchor_.counted;
    since_anchor_.counted = Soc(before + d);
    const Variance more = Variance((before + since_anchor_.counted) * d);
    return more > Variance(0) ? arithmetic::product<Variance>(arithmetic::product<Variance>(more, gain), gain)
                              : Variance(0);
  }
  /// A gain's part of sigma is not more than sigma.
  constexpr void bound_gain_error(const Soc& soc, const Soc& sigma, const Fraction& gain) {
    since_anchor_.soc = soc;
    if (!(arithmetic::magnitude(Soc(since_anchor_.counted * gain)) > sigma)) return;
    const auto most = arithmetic::ratio<Soc>(sigma, Soc(gain));
    since_anchor_.counted = since_anchor_.counted > Soc(0) ? most : Soc(-most);
  }

  static constexpr double outlier_sigmas =
      8;  // standard deviations; a cell that was emptied fast shows five of them for minutes
  static constexpr double uncorrelated_share =
      1.0 / 4;                                 // of the variance of an error that lasts: half of it comes and goes
  static constexpr double min_error_v = 0.01;  // of any model, whatever its file says
  static constexpr std::uint32_t restart_after_us =
      600'000'000;  // of it before soc is sought anew: near empty a cell needs minutes to recover
  static constexpr std::uint32_t outlier_reset_us = 60'000'000;  // without it, and it is forgotten

  using At = model::TablePoint<S>;

  template <class Cell>
  constexpr void correct(const Cell& cell, const At& at, const StepInput& input, const Soc& soc,
                         const Voltage& innovation_v, std::uint32_t& flags) {
    const Voltage drop_v = steady_state_drop_v<S>(at, input.current_a);
    const Variance drop_v2 = drop_v * drop_v;
    if (bank_.open()) [[unlikely]] {
      flags |= soc_ambiguous;
      return update_from_bank(cell, input.current_a, input.temperature_c, soc, innovation_v);
    }
    if (arithmetic::magnitude(innovation_v) > Voltage(outlier_sigmas * min_error_v)) [[unlikely]] {
      if (reject_outlier(cell, input.current_a, input.temperature_c, soc, innovation_v)) {
        flags |= voltage_rejected;
        return;
      }
    }
    Variance error_v2 = at.error_v2;
    if constexpr (Model::errors_are_states)
      error_v2 = Variance(arithmetic::product<Variance>(cell.noise.model_v2, Fraction(uncorrelated_share)) +
                          soc_axis_variance(cell, at));
    const Variance model_v2 = Variance(arithmetic::product<Variance>(error_v2, correlated_samples_) +
                                       arithmetic::product<Variance>(drop_v2, resistance_noise_));
    const Variance noise_v2 = Variance(cell.noise.voltage_v2 + model_v2);
    apply_correction(
        state_.covariance.observe(Model::measurement_jacobian(laws_of(cell), at, input), noise_v2, innovation_v),
        cell.charge);
  }

  /// An innovation that the model's error and soc's own sigma do not explain, for ten minutes, is soc's: it is sought
  /// anew. True: it is.
  template <class Cell>
  [[gnu::noinline]] constexpr bool reject_outlier(const Cell& cell, Current current_a,
                                                  arithmetic::Temperature<S> temperature_c, Soc soc,
                                                  Voltage innovation_v) {
    const StepInput input{current_a, duration_s_, temperature_c};
    std::uint8_t interval = interval_;
    const At at =
        look_up(model::OperatingPoint{cell, input, Model::mechanism_states(state_.model_state)}, soc, interval);
    const auto h = Model::measurement_jacobian(laws_of(cell), at, input);
    const Variance of_soc_v2 = arithmetic::product<Variance>(
        arithmetic::product<Variance>(state_.covariance.template variance<Model::soc>(), h[Model::soc]), h[Model::soc]);
    const Variance error_v2 =
        Variance(Variance(at.error_v2 - cell.noise.model_v2) +
                 Variance(persistent_variance(cell) + drop_variance_v2<S>(at, current_a, resistance_error_)));
    const Variance all_v2 = Variance(Variance(error_v2 + of_soc_v2) + cell.noise.voltage_v2);
    if (!(Variance(innovation_v * innovation_v) > Variance(all_v2 * Count(outlier_sigmas * outlier_sigmas))))
      return false;
    if (time_us_ - last_outlier_us_ > outlier_reset_us + step_us_) outlier_duration_us_ = 0;
    last_outlier_us_ = time_us_;
    outlier_duration_us_ += step_us_ < outlier_reset_us ? static_cast<std::uint32_t>(step_us_) : outlier_reset_us;
    if (outlier_duration_us_ < restart_after_us) return true;  // one bad reading is not believed
    outlier_duration_us_ = 0;
    const Variance finest(1.0 / (SocBank<S>::points * SocBank<S>::points)),
        variance = state_.covariance.template variance<Model::soc>();
    restart_around(cell, {soc, variance < finest ? finest : variance});
    return true;
  }

  /// Of what the tables' soc axis is good to, on the curve there. In the cold surfaces are further ahead of what is
  /// counted, as much as resistances are larger: knees come elsewhere.
  template <class Cell>
  static constexpr Variance soc_axis_variance(const Cell& cell, const At& at) {
    const Variance soc_axis_variance = Variance(at.error_v2 - cell.noise.model_v2);
    if constexpr (std::same_as<std::remove_cvref_t<decltype(laws_of(cell))>, model::LawSet<S>>)
      return soc_axis_variance;
    else
      return at.activation > arithmetic::Factor<S>(1)
                 ? arithmetic::product<Variance>(arithmetic::product<Variance>(soc_axis_variance, at.activation),
                                                 at.activation)
                 : soc_axis_variance;
  }

  /// Opens the bank around a belief that may be mistaken.
  template <class Cell>
  constexpr void restart_around(const Cell& cell, const SocDistribution<S>& before) {
    open_bank(cell, before.soc, StartMisfit<S, Cell>{cell, nullptr, Variance{}, &before});
  }
  template <class Cell, class Misfit>
  constexpr void open_bank(const Cell& cell, const Soc& mean, const Misfit& misfit) {
    std::uint8_t interval = 0;
    bank_.open_at(mean, persistent_variance(cell),
                  [&](const Soc& soc) { return misfit(soc, Fraction(0.5 / SocBank<S>::points), interval); });
  }

  /// Of an error that lasts while the bank is open: the model's, and of the states that are not corrected then.
  template <class Cell>
  constexpr Variance persistent_variance(const Cell& cell) const {
    Variance sum = Model::errors_are_states ? Variance{} : cell.noise.model_v2;
    const auto states_v2 = state_.covariance.variances();
    for (std::size_t k = 0; k < Model::soc; ++k) sum = Variance(sum + states_v2[k]);
    return sum;
  }

  /// While it is open, soc is the bank's; the other states go on as predicted.
  /// Arguments by value: one passed by address would be kept in memory in every step.
  template <class Cell>
  [[gnu::noinline]] constexpr void update_from_bank(const Cell& cell, Current current_a,
                                                    arithmetic::Temperature<S> temperature_c, Soc soc,
                                                    Voltage innovation_v) {
    const StepInput input{current_a, duration_s_, temperature_c};
    const auto& laws = laws_of(cell);
    std::uint8_t interval = interval_;
    const model::OperatingPoint operating_point{cell, input, Model::mechanism_states(state_.model_state)};
    const At middle = look_up(operating_point, soc, interval);
    const Voltage expected_v = Model::voltage(laws, state_.model_state, middle, input);
    const Variance new_v2 = Variance(arithmetic::product<Variance>(cell.noise.model_v2, Fraction(uncorrelated_share)) +
                                     drop_variance_v2<S>(middle, current_a, resistance_error_));
    const auto observation = [&](const Soc& there) -> typename SocBank<S>::Observation {
      const At at = look_up(operating_point, there, interval);
      return {.off_v = Voltage(innovation_v + (expected_v - Model::voltage(laws, state_.model_state, at, input))),
              .half_v = Voltage(ocv_slope<S>(at) * Fraction(0.5 / SocBank<S>::points)),
              .new_v2 = Variance(new_v2 + soc_axis_variance(cell, at))};
    };
    const auto bank_update = bank_.step(
        soc, bank_share_, cell.noise.voltage_v2,
        Variance(persistent_variance(cell) + drop_variance_v2<S>(middle, current_a, resistance_error_)), observation);
    if (!bank_update.ready) return;
    state_.charge.correct(bank_update.moved, cell.charge);
    state_.covariance.template reset<Model::soc>(bank_update.variance);
    if (bank_update.variance < Variance(SocBank<S>::close_below_sigma * SocBank<S>::close_below_sigma)) bank_.close();
  }

  template <class Cell>
  constexpr void fill_state(const Cell& cell, Result& estimate) const {
    estimate.soc = state_.charge.soc(cell.charge);
    estimate.soc_sigma = arithmetic::root<Soc>(state_.covariance.template variance<Model::soc>());
    estimate.v_rc_v = state_.model_state[0];
    if constexpr (extra_values > 0) {
      std::size_t next = 0;
      if constexpr (Model::errors_are_states) {
        estimate.extra[next++] = state_.model_state[Model::voltage_error];
        estimate.extra[next++] = state_.model_state[Model::current_offset];
        estimate.extra[next++] = arithmetic::root<Voltage>(state_.covariance.template variance<Model::last>());
      }
      for (std::size_t k = Model::first_mechanism_state; k < Model::values; ++k)
        estimate.extra[next++] = state_.model_state[k];
    }
  }

  template <class Cell>
  [[gnu::noinline]] constexpr Result repeated_estimate(const Cell& cell, std::uint32_t flags) const {
    Result estimate;
    estimate.flags = flags;
    const StepInput rest{Current(0), TimeStep(1)};
    std::uint8_t interval = interval_;
    const auto at = look_up(model::OperatingPoint{cell, rest, Model::mechanism_states(state_.model_state)},
                            state_.charge.soc(cell.charge), interval);
    estimate.voltage_predicted_v = Model::voltage(laws_of(cell), state_.model_state, at, rest);
    fill_state(cell, estimate);
    return estimate;
  }

  template <class Cell>
  [[gnu::noinline]] constexpr Result start(const Cell& cell, const measurement::Sample& sample) {
    Result estimate;
    time_us_ = sample.time_us;
    const AcceptedCurrent current = check_.current(sample.current_ua, cell.plausible, estimate.flags);
    const bool voltage = InputCheck<S>::voltage_present(sample.voltage_uv, cell.plausible, estimate.flags);
    if (!voltage && !has_start_) {
      estimate.flags |= not_started;
      estimate.soc = Soc(0.5);
      estimate.soc_sigma = Soc(0.289);  // anything from 0 to 1: 1 / sqrt(12)
      return estimate;
    }
    started_ = true;

    const auto& laws = laws_of(cell);
    const StepInput input{laws.true_current(arithmetic::from_micro<Current>(current.ua)), TimeStep(1),
                          temperature(laws, sample)};
    SocDistribution<S> belief{soc_of_ppb(from_.soc_ppb), Variance{}};
    const Soc believed_sigma = soc_of_ppb(from_.soc_sigma_ppb);
    belief.variance = Variance(believed_sigma * believed_sigma);
    // how much the current has built up is unknown: half of what it can, give or take the same; and what flowed before
    // it
    const model::OperatingPoint operating_point{cell, input, Model::mechanism_states(state_.model_state)};
    auto at = look_up(operating_point, has_start_ ? belief.soc : Soc(0.5), interval_);
    const Voltage half_v = at.r1_ohm * Fraction(0.5) * input.current_a;
    const Voltage before_v = at.r1_ohm * cell.noise.unknown_a;
    const Variance half_v2 = Variance(half_v * half_v) + Variance(before_v * before_v);
    std::array<Variance, states> variances{};
    variances[0] = cell.noise.v_rc_v2 + half_v2;
    Model::start(laws, state_.model_state, variances, at, input, cell.noise);
    // a belief finer than the points of the grid needs no help from a voltage
    const auto finest = Soc(2.0 / start_points);
    if (!has_start_ || believed_sigma > finest) {
      const Voltage load_v = half_v + Model::sum_v(state_.model_state) + at.r0_ohm * input.current_a;
      Variance reading_v2 = cell.noise.rest_v2 + half_v2;
      for (std::size_t k = Model::first_voltage; k < Model::soc; ++k) reading_v2 = Variance(reading_v2 + variances[k]);
      if (!current.measured) {
        const Voltage unknown_v = at.r0_ohm * cell.noise.unknown_a;
        reading_v2 = Variance(reading_v2 + unknown_v * unknown_v);
      }
      const Voltage ocv_v =
          voltage ? Voltage(Model::true_voltage(laws, arithmetic::from_micro<Voltage>(sample.voltage_uv)) - load_v)
                  : Voltage(0);
      const SocDistribution<S> before = belief;
      const StartMisfit<S, decltype(operating_point)> misfit{operating_point, voltage ? &ocv_v : nullptr, reading_v2,
                                                             has_start_ ? &before : nullptr};
      if (voltage) belief = soc_from(misfit);
      if (belief.variance > Variance(SocBank<S>::open_above_sigma * SocBank<S>::open_above_sigma)) {
        state_.covariance.set_diagonal(variances);  // what the bank is told of the other states
        open_bank(cell, belief.soc, misfit);
      }
      at = look_up(operating_point, belief.soc, interval_);
    }
    state_.charge.set(belief.soc, cell.charge);
    state_.model_state[0] = half_v;
    variances[Model::soc] = belief.variance;
    state_.covariance.set_diagonal(variances);
    estimate.voltage_predicted_v = Model::voltage(laws, state_.model_state, at, input);
    fill_state(cell, estimate);
    if constexpr (Model::errors_are_states) since_anchor_.soc = estimate.soc;
    return estimate;
  }

  static constexpr Soc soc_of_ppb(std::int32_t ppb) {
    return Soc(arithmetic::from_micro<arithmetic::Current<S>>(ppb) * Fraction(1e-3));
  }

  CellState<S, ModelOf> state_;
  InputCheck<S> check_;
  struct SinceAnchor {
    Soc soc{}, counted{};
  };
  struct Empty {};
  [[no_unique_address]] std::conditional_t<Model::errors_are_states, SinceAnchor, Empty> since_anchor_;
  [[no_unique_address]] std::conditional_t<Model::errors_are_states, CurrentAtRest, Empty> at_rest_;
  std::uint64_t time_us_ = 0;
  std::uint64_t step_us_ = 0;
  std::uint64_t last_outlier_us_ = 0;
  std::uint32_t outlier_duration_us_ = 0;
  std::uint8_t interval_ = 0;
  std::int16_t temperature_cdegc_ = 2'500;
  TimeStep duration_s_{};
  Variance soc_noise_{};
  Count correlated_samples_{1};
  Coupling resistance_error_{}, resistance_noise_{};  ///< of R0 + R1; and as it counts in the noise of a step
  std::int16_t temperature_bin_ = 0x7FFF;             ///< no temperature's
  Fraction bank_share_{};
  [[no_unique_address]] typename Model::OptionalErrorDecay error_decay_{};
  SocBank<S> bank_;
  measurement::StartingPoint from_;
  bool has_start_ = false, started_ = false;
};

}  // namespace bms::estimator
