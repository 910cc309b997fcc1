// Ordinary steps of the estimator for several cells at once: the filter of estimator/soc_estimator.hpp with Lanes as
// its scalar. Each lane has the bits of the estimator in float.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "arithmetic/lanes.hpp"
#include "replay/lane_access.hpp"
#include "replay/lane_cells.hpp"

namespace bms::replay {

/// The samples of one time, one in each lane.
template <std::size_t Registers>
struct LaneReadings {
  using Array = typename arithmetic::IntLanes<Registers>::Array;
  const Array &current_ua, &voltage_uv;
};

template <std::size_t Registers, template <class> class ModelOf>
class LaneFilter {
  using S = arithmetic::Lanes<Registers>;
  using Int = arithmetic::IntLanes<Registers>;
  using Mask = typename S::Mask;
  using Model = ModelOf<S>;
  using Errors = estimator::PersistentErrors<S, ModelOf>;
  using State = estimator::CellState<S, ModelOf>;
  using Charge = estimator::Charge<S>;
  using Access = estimator::LaneAccess;

 public:
  /// Steps every lane. Returns where the step is ordinary; the other lanes have not changed.
  [[gnu::flatten]] Mask step(const LaneCells<Registers>& cells, const LaneReadings<Registers>& read, const Mask& wanted,
                             estimator::Estimate<S>& estimate) {
    State next = state_;
    next.charge.count(read.current_ua, file_us_);
    const S soc = next.charge.soc(cells.charge);
    const model::LawSet<S> laws;
    const Int current_ua(read.current_ua), voltage_uv(read.voltage_uv);
    const model::StepInput<S> input{from_micro(current_ua), constants_.duration_s};
    const auto at = look_up(cells, soc, intervals_);
    const auto discretisation = Model::discretise(laws, next.model_state, at, input);
    auto noise = Model::noise(laws, discretisation, cells.noise);
    noise[Model::soc] = constants_.soc_noise;
    next.covariance.template propagate<typename Model::Couples>(
        Model::state_transition(next.model_state, at, discretisation, input), noise);
    next.model_state = Model::advance(next.model_state, at, discretisation, input);

    const S predicted_v = Model::voltage(laws, next.model_state, at, input),
            innovation_v = from_micro(voltage_uv) - predicted_v;
    const S noise_v2 =
        reading_noise_v2_ + estimator::model_noise_v2<S, Errors>(cells.noise, at, input.current_a, constants_);
    next.apply(next.covariance.observe(Model::measurement_jacobian(laws, at, input), noise_v2, innovation_v),
               cells.charge);
    estimate.soc = next.charge.soc(cells.charge);
    estimate.soc_sigma = sqrt(next.soc_variance());
    estimate.v_rc_v = next.model_state[0];
    estimate.voltage_predicted_v = predicted_v;

    Voltage voltage = voltage_;
    const Mask ordinary = wanted & plausible(cells, current_ua, voltage_uv) &
                          voltage.follows(voltage_uv, at.r0_ohm * input.current_a) &
                          (magnitude(innovation_v) <= unchecked_below_v_) & is_finite(estimate) &
                          Charge::in_range(soc) & Charge::in_range(estimate.soc);
    const S corrected = corrected_ + (estimate.soc - soc);
    if (all(ordinary)) [[likely]] {
      corrected_ = corrected;
      state_ = next;
      voltage_ = voltage;
    } else {
      corrected_ = select(ordinary, corrected, corrected_);
      state_ = Access::chosen(ordinary, next, state_);
      voltage_ = chosen(ordinary, voltage, voltage_);
    }
    return ordinary;
  }

  /// Sets one lane to the values of an estimator.
  void set(std::size_t lane, const LaneValues<ModelOf>& v) {
    Access::set(state_, lane, v.state);
    voltage_.uv.set(lane, v.voltage_uv);
    voltage_.repeats.set(lane, v.repeats);
    voltage_.drop_at_change_v.set(lane, v.drop_at_change_v);
    corrected_.set(lane, v.corrected);
    reading_noise_v2_.set(lane, v.reading_noise_v2);
    unchecked_below_v_.set(lane, v.unchecked_below_v);
    set_constants(lane, v);
  }
  /// What depends on the time step and the temperature.
  void set_constants(std::size_t lane, const LaneValues<ModelOf>& v) {
    file_us_[lane] = v.file_us;
    constants_.duration_s.set(lane, v.duration_s);
    constants_.soc_noise.set(lane, v.soc_noise);
    constants_.correlated.set(lane, v.correlated_samples);
    constants_.resistance.set(lane, v.resistance_noise);
  }
  /// Writes what steps have changed in one lane.
  void get(std::size_t lane, LaneValues<ModelOf>& v) const {
    v.state = Access::get(state_, lane);
    v.voltage_uv = voltage_.uv[lane];
    v.repeats = voltage_.repeats[lane];
    v.drop_at_change_v = voltage_.drop_at_change_v[lane];
    v.corrected = corrected_[lane];
  }

 private:
  using Check = estimator::InputCheck<float>;

  /// The last voltage, as estimator::InputCheck stores it.
  struct Voltage {
    Int uv, repeats;
    S drop_at_change_v;

    /// Returns where the voltage is not stuck, or not yet.
    Mask follows(const Int& now_uv, const S& drop_v) {
      const Int one(1), none(0);
      const auto same = now_uv == uv;
      const Mask same_v = select(same, one, none).template as<S>() > S(0.0F);
      const Mask lasts = select(repeats >= Int(std::int32_t{Check::stuck_after}), one, none).template as<S>() > S(0.0F);
      const Mask is_stuck = select(repeats == Int(Access::stuck), one, none).template as<S>() > S(0.0F);
      const S limit_v(Check::stuck_move_v), moved_v = drop_v - drop_at_change_v;
      const Mask stuck = same_v & lasts & (is_stuck | (moved_v > limit_v) | (moved_v < -limit_v));
      repeats = select(same, select(repeats >= Int(std::int32_t{Check::stuck_after}), repeats, repeats + one), none);
      drop_at_change_v = select(same_v, drop_at_change_v, drop_v);
      uv = now_uv;
      return !stuck;
    }
  };
  static Voltage chosen(const Mask& mask, const Voltage& a, const Voltage& b) {
    Voltage c = b;
    for (std::size_t lane = 0; lane < S::size; ++lane) {
      if (!mask[lane]) continue;
      c.uv.set(lane, a.uv[lane]);
      c.repeats.set(lane, a.repeats[lane]);
      c.drop_at_change_v.set(lane, a.drop_at_change_v[lane]);
    }
    return c;
  }

  /// Returns where current and voltage are in their plausible ranges.
  static Mask plausible(const LaneCells<Registers>& cells, const Int& current_ua, const Int& voltage_uv) {
    const auto good = (current_ua <= cells.current_max_ua) & (-cells.current_max_ua <= current_ua) &
                      (voltage_uv <= cells.voltage_max_uv) & (cells.voltage_min_uv <= voltage_uv);
    return select(good, Int(1), Int(0)).template as<S>() > S(0.0F);
  }

  /// What StepConstants computes.
  struct Constants {
    S duration_s, soc_noise, correlated, resistance;

    const S& correlated_samples() const { return correlated; }
    const S& resistance_noise() const { return resistance; }
  };

  State state_;
  Voltage voltage_;
  Constants constants_;
  std::array<std::int64_t, S::size> file_us_{};
  S corrected_;  ///< SocEstimator::corrected_
  S reading_noise_v2_, unchecked_below_v_;
  LaneIntervals<Registers> intervals_;
};

}  // namespace bms::replay
