// State of charge of one cell: an extended Kalman filter over a cell model's states, one sample in, one estimate out.
//
//   predict   charge counted in integers, other states by the model's exact step, covariance by its analytic transition
//   correct   by the voltage, if it may be believed; otherwise the prediction stands and sigma grows
//
// One body for every scalar and every model with the interface of model::OneRc (N states, soc last among the physical ones).
// No heap, no exceptions, no libm but sqrt, no clock: the same samples give the same bits on every core (float and
// fixed point; compile with -ffp-contract=off).
//
// Voltage noise: a reading's own noise is new in every sample, the model's error is not. One that lasts for T seconds counts once
// per T: at a step dt its variance is taken T / dt times.
//
// Memory: CellState<float> 24 bytes a cell; the rest is shared or guards inputs. Cost in instructions: estimator/README.md.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/charge.hpp"
#include "estimator/estimate.hpp"
#include "estimator/input_check.hpp"
#include "estimator/sample.hpp"
#include "estimator/start.hpp"
#include "estimator/ud_covariance.hpp"
#include "model/one_rc.hpp"

namespace bms {

/// What is remembered of one cell from sample to sample.
template <class S, template <class> class Model>
struct CellState {
  Charge<S> charge;
  UdCovariance<S, Model<S>::states> covariance;
  typename Model<S>::Polarisation polarisation{};
};

template <class S, template <class> class ModelOf = model::OneRc>
class SocEstimator {
 public:
  using Model = ModelOf<S>;
  static constexpr std::size_t states = Model::states;

  constexpr SocEstimator() = default;

  /// Begins at a known state of charge instead of one read from the first voltage.
  constexpr explicit SocEstimator(const StartingPoint& from) : from_{from}, has_start_{true} {}

  /// The only call. cell: prepared for S, the same in every call.
  template <class Cell>
  constexpr Estimate<S> step(const Cell& cell, const Sample& sample) {
    if (!started_) return start(cell, sample);
    if (sample.time_us <= time_us_) return unchanged(cell, time_not_later);

    Estimate<S> estimate;
    const std::uint64_t step_us = sample.time_us - time_us_;
    time_us_ = sample.time_us;
    const BelievedCurrent current = check_.current(sample.current_ua, cell.plausible, estimate.flags);
    if (step_us != paced_us_) change_pace(cell, step_us, estimate.flags);
    count_charge(cell, current.ua, step_us);

    const Soc soc = state_.charge.soc(cell.charge);
    const auto at = model::look_up(cell, soc, interval_);
    const model::Drive<S> drive{model::from_micro<model::Current<S>>(current.ua), duration_s_};
    const auto settling = Model::settling(at, drive.duration_s);

    std::array<Variance, states> noise{};
    // steady state v_rc variance: what decays in a step, 1 - (1 - p)^2, comes back
    noise[0] = model::product<Variance>(cell.noise.v_rc_v2, Fraction(settling.settled * Fraction(Fraction(2) - settling.settled)));
    noise[states - 1] = soc_noise_;
    if ((estimate.flags & (time_gap | current_missing | current_implausible)) != 0) [[unlikely]] noise[states - 1] = Variance(soc_noise_ + unknown_charge(cell));
    state_.covariance.propagate(Model::transition(state_.polarisation, at, settling, drive), noise);
    state_.polarisation = Model::advance(state_.polarisation, at, settling, drive);

    estimate.voltage_predicted_v = Model::voltage(state_.polarisation, at, drive);
    if (check_.voltage_usable(sample.voltage_uv, estimate.voltage_predicted_v, cell.plausible, estimate.flags)) {
      const Voltage innovation_v = model::from_micro<Voltage>(sample.voltage_uv) - estimate.voltage_predicted_v;
      correct(cell, Model::sensitivity(at, drive), innovation_v);
    }
    complete(cell, estimate);
    return estimate;
  }

  constexpr const CellState<S, ModelOf>& state() const { return state_; }

 private:
  using Soc = model::Soc<S>;
  using Voltage = model::Voltage<S>;
  using Variance = model::Variance<S>;
  using Fraction = model::Fraction<S>;
  using TimeStep = model::TimeStep<S>;

  static constexpr std::uint32_t longest_step_us = 4'095'000'000U;  // a longer one has settled everything; TimeStep's range
  static constexpr std::uint32_t longest_count_us = 2'000'000'000U;
  static constexpr int longest_gap_counts = 1'000;                   // 23 days; nothing is known after that

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
  [[gnu::noinline]] constexpr void change_pace(const Cell& cell, std::uint64_t step_us, std::uint32_t& flags) {
    paced_us_ = step_us;
    const std::uint32_t capped_us = step_us < longest_step_us ? static_cast<std::uint32_t>(step_us) : longest_step_us;
    check_.gap(capped_us, flags);
    duration_s_ = seconds(capped_us);
    const model::FilterNoise<S>& n = cell.noise;
    const auto shared_by = model::ratio<model::Count<S>>(n.model_correlation_s, duration_s_);
    voltage_noise_ = n.voltage_v2 + (shared_by > model::Count<S>(1) ? model::product<Variance>(n.model_v2, shared_by) : n.model_v2);
    const Soc white = n.white_soc_per_s * duration_s_;
    soc_noise_ = Variance(white * white) + model::product<Variance>(n.walk_soc2_per_s, duration_s_);
  }

  static constexpr TimeStep seconds(std::uint32_t us) {
    if constexpr (model::is_q<TimeStep>) {
      return model::ratio<TimeStep>(model::Q<32, 0>::from_raw(us), model::Q<20, 0>(1'000'000));
    } else if constexpr (std::same_as<TimeStep, float>) {
      return static_cast<float>(us) * 1e-6F;
    } else {
      return TimeStep(static_cast<double>(us) * 1e-6);
    }
  }

  /// Variance to add when the charge of a step may be wrong by a current that nobody measured. Such an error goes on in the same
  /// direction, so standard deviations add: (sigma + d)^2 - sigma^2.
  template <class Cell>
  constexpr Variance unknown_charge(const Cell& cell) const {
    const Soc most(1);
    Soc d = cell.noise.unknown_soc_per_s * duration_s_;
    if (d > most) d = most;
    const Soc sigma = model::root<Soc>(state_.covariance.last_variance());
    return Variance(d * d) + Variance((sigma + sigma) * d);
  }

  template <class Cell, class Row>
  constexpr void correct(const Cell& cell, const Row& sensitivity, const Voltage& innovation_v) {
    const auto correction = state_.covariance.observe(sensitivity, voltage_noise_, innovation_v);
#pragma GCC unroll 8
    for (std::size_t i = 0; i + 1 < states; ++i) state_.polarisation[i] += correction[i];
    state_.charge.correct(correction[states - 1], cell.charge);
  }

  template <class Cell>
  constexpr void complete(const Cell& cell, Estimate<S>& estimate) const {
    estimate.soc = state_.charge.soc(cell.charge);
    estimate.soc_sigma = model::root<Soc>(state_.covariance.last_variance());
    estimate.v_rc_v = state_.polarisation[0];
  }

  template <class Cell>
  [[gnu::noinline]] constexpr Estimate<S> unchanged(const Cell& cell, std::uint32_t flags) const {
    Estimate<S> estimate;
    estimate.flags = flags;
    const auto at = model::look_up(cell, state_.charge.soc(cell.charge));
    estimate.voltage_predicted_v = at.ocv_v + state_.polarisation[0];
    complete(cell, estimate);
    return estimate;
  }

  template <class Cell>
  [[gnu::noinline]] constexpr Estimate<S> start(const Cell& cell, const Sample& sample) {
    Estimate<S> estimate;
    const BelievedCurrent current = check_.current(sample.current_ua, cell.plausible, estimate.flags);
    const bool voltage = InputCheck<S>::voltage_present(sample.voltage_uv, cell.plausible, estimate.flags);
    if (!voltage && !has_start_) {
      estimate.flags |= not_started;
      estimate.soc = Soc(0.5);
      estimate.soc_sigma = Soc(0.289);  // anything from 0 to 1: 1 / sqrt(12)
      return estimate;
    }
    started_ = true;
    time_us_ = sample.time_us;

    const model::Drive<S> drive{model::from_micro<model::Current<S>>(current.ua), TimeStep(1)};
    SocBelief<S> belief{soc_of_ppb(from_.soc_ppb), Variance{}};
    const Soc believed_sigma = soc_of_ppb(from_.soc_sigma_ppb);
    belief.variance = Variance(believed_sigma * believed_sigma);
    // how much the current has built up is unknown: half of what it can, give or take the same
    auto at = model::look_up(cell, has_start_ ? belief.soc : Soc(0.5));
    const Voltage half_v = at.r1_ohm * Fraction(0.5) * drive.current_a;
    const Variance half_v2 = half_v * half_v;
    if (!has_start_) {
      const Voltage load_v = half_v + at.r0_ohm * drive.current_a;
      belief = soc_from_ocv<S>(cell, Voltage(model::from_micro<Voltage>(sample.voltage_uv) - load_v), Variance(cell.noise.rest_v2 + half_v2));
      at = model::look_up(cell, belief.soc);
    }
    state_.charge.set(belief.soc, cell.charge);
    state_.polarisation[0] = half_v;
    std::array<Variance, states> variances{};
    variances[0] = cell.noise.v_rc_v2 + half_v2;
    variances[states - 1] = belief.variance;
    state_.covariance.set_diagonal(variances);
    estimate.voltage_predicted_v = Model::voltage(state_.polarisation, at, drive);
    complete(cell, estimate);
    return estimate;
  }

  static constexpr Soc soc_of_ppb(std::int32_t ppb) {
    return Soc(model::from_micro<model::Current<S>>(ppb) * Fraction(1e-3));
  }

  CellState<S, ModelOf> state_;
  InputCheck<S> check_;
  std::uint64_t time_us_ = 0;
  std::uint64_t paced_us_ = 0;
  std::uint8_t interval_ = 0;
  TimeStep duration_s_{};
  Variance voltage_noise_{}, soc_noise_{};
  StartingPoint from_;
  bool has_start_ = false, started_ = false;
};

}  // namespace bms
