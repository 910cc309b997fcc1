// What an ordinary step of the estimator reads and writes. An ordinary step has a plausible current, a voltage that is
// neither missing nor stuck nor suspect, and the same duration and range of temperatures as the step before; about one
// in sixty is not ordinary at 1 Hz. Ordinary steps of many cells are computed at once
// (host_sim/replay/lane_filter.hpp), all others by the estimator itself.
#pragma once

#include <cstdint>

#include "estimator/soc_estimator.hpp"

namespace bms::replay {

/// Of one cell.
template <template <class> class ModelOf>
struct LaneValues {
  estimator::CellState<float, ModelOf> state;
  // of the check of the inputs
  std::int32_t current_ua = 0, voltage_uv = 0, repeats = 0;
  float drop_at_change_v = 0;
  std::uint64_t time_us = 0;
  float corrected = 0;
  // these change in other steps only
  std::uint64_t step_us = 0;  ///< of an ordinary step; 0: no step is ordinary
  std::int32_t file_us = 0;   ///< for which the charge counts the current then
  std::int32_t temperature_bin = 0;
  float duration_s = 0, soc_noise = 0, correlated_samples = 0, resistance_noise = 0;
  float reading_noise_v2 = 0, unchecked_below_v = 0;
};

}  // namespace bms::replay

namespace bms::estimator {

/// Reads and writes what is private in the estimator and its parts.
struct LaneAccess {
  static constexpr std::int32_t temperature_bin(std::int16_t cdegc) {
    return cdegc >> SocEstimator<float>::temperature_bin_bits;
  }
  static constexpr std::int32_t stuck = InputCheck<float>::stuck;

  template <template <class> class ModelOf>
  static replay::LaneValues<ModelOf> read(const SocEstimator<float, ModelOf>& e) {
    return {.state = e.state_,
            .current_ua = e.check_.current_ua_,
            .voltage_uv = e.check_.voltage_uv_,
            .repeats = e.check_.repeats_,
            .drop_at_change_v = e.check_.drop_at_change_v_,
            .time_us = e.time_us_,
            .corrected = e.count_.corrected_,
            .step_us = e.started_ && e.count_.file_us_ >= 0 ? e.checked_step_us_ : 0,
            .file_us = e.count_.file_us_,
            .temperature_bin = e.temperature_bin_,
            .duration_s = e.constants_.duration_s(),
            .soc_noise = e.constants_.soc_noise(),
            .correlated_samples = e.constants_.correlated_samples(),
            .resistance_noise = e.constants_.resistance_noise(),
            .reading_noise_v2 = e.monitor_.reading_noise_v2(),
            .unchecked_below_v = e.monitor_.consistency_.unchecked_below_v_};
  }
  /// A temperature in another bin.
  template <template <class> class ModelOf, class Cell>
  static void set_temperature(SocEstimator<float, ModelOf>& e, const Cell& cell, std::int16_t cdegc,
                              replay::LaneValues<ModelOf>& present) {
    e.set_temperature(cell, cdegc);
    present.temperature_bin = e.temperature_bin_;
    present.resistance_noise = e.constants_.resistance_noise();
  }
  /// Writes what an ordinary step changes.
  template <template <class> class ModelOf>
  static void write(const replay::LaneValues<ModelOf>& from, SocEstimator<float, ModelOf>& e) {
    e.state_ = from.state;
    e.check_.current_ua_ = from.current_ua;
    e.check_.voltage_uv_ = from.voltage_uv;
    e.check_.repeats_ = static_cast<std::uint8_t>(from.repeats);
    e.check_.drop_at_change_v_ = from.drop_at_change_v;
    e.time_us_ = from.time_us;
    e.count_.corrected_ = from.corrected;
  }

  /// One lane of a state in lanes.
  template <class S, template <class> class ModelOf>
  static void set(CellState<S, ModelOf>& lanes, std::size_t lane, const CellState<float, ModelOf>& one) {
    lanes.charge.set(lane, one.charge.uaus_);
    for (std::size_t k = 0; k < one.covariance.d_.size(); ++k) lanes.covariance.d_[k].set(lane, one.covariance.d_[k]);
    for (std::size_t k = 0; k < one.covariance.u_.size(); ++k) lanes.covariance.u_[k].set(lane, one.covariance.u_[k]);
    for (std::size_t k = 0; k < one.model_state.size(); ++k) lanes.model_state[k].set(lane, one.model_state[k]);
  }
  template <class S, template <class> class ModelOf>
  static CellState<float, ModelOf> get(const CellState<S, ModelOf>& lanes, std::size_t lane) {
    CellState<float, ModelOf> one;
    one.charge.uaus_ = lanes.charge.get(lane);
    for (std::size_t k = 0; k < one.covariance.d_.size(); ++k) one.covariance.d_[k] = lanes.covariance.d_[k][lane];
    for (std::size_t k = 0; k < one.covariance.u_.size(); ++k) one.covariance.u_[k] = lanes.covariance.u_[k][lane];
    for (std::size_t k = 0; k < one.model_state.size(); ++k) one.model_state[k] = lanes.model_state[k][lane];
    return one;
  }
  /// One state or the other, lane by lane.
  template <class S, template <class> class ModelOf>
  static CellState<S, ModelOf> chosen(const typename S::Mask& mask, const CellState<S, ModelOf>& a,
                                      const CellState<S, ModelOf>& b) {
    CellState<S, ModelOf> c;
    c.charge = select(mask, a.charge, b.charge);
    for (std::size_t k = 0; k < c.covariance.d_.size(); ++k)
      c.covariance.d_[k] = select(mask, a.covariance.d_[k], b.covariance.d_[k]);
    for (std::size_t k = 0; k < c.covariance.u_.size(); ++k)
      c.covariance.u_[k] = select(mask, a.covariance.u_[k], b.covariance.u_[k]);
    for (std::size_t k = 0; k < c.model_state.size(); ++k)
      c.model_state[k] = select(mask, a.model_state[k], b.model_state[k]);
    return c;
  }
};

}  // namespace bms::estimator
