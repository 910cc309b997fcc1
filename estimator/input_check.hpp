// Decides what of a sample may be believed. Costs the filter nothing but a flag: a reading that fails is left out, not mended.
//
//   missing       no_reading
//   implausible   outside what the cell and its sensor can have (model::Plausible)
//   stuck         the same voltage to the last digit for `stuck_after` samples while the model's moved by `stuck_move_v`;
//                 believed again when it changes
//   gap           a step more than `gap_factor` times the one before
//
// A current that is left out is replaced by the last one believed, and its uncertainty by the cell file's current_unknown_a.
#pragma once

#include <cstdint>

#include "estimator/estimate.hpp"
#include "estimator/sample.hpp"
#include "model/cell.hpp"

namespace bms {

/// A current to count with, and whether it was measured.
struct BelievedCurrent {
  std::int32_t ua;
  bool measured;
};

template <class S>
class InputCheck {
 public:
  static constexpr std::uint8_t stuck_after = 5;
  static constexpr std::uint32_t gap_factor = 10;
  static constexpr double stuck_move_v = 0.02;  // far above any ADC's step, below any load's effect

  constexpr BelievedCurrent current(std::int32_t current_ua, const model::Plausible& plausible, std::uint32_t& flags) {
    if (current_ua == no_reading) {
      flags |= current_missing;
    } else if (current_ua > plausible.current_max_ua || current_ua < -plausible.current_max_ua) {
      flags |= current_implausible;
    } else {
      current_ua_ = current_ua;
      return {current_ua, true};
    }
    return {current_ua_, false};
  }

  /// predicted_v: what the model expects of this reading.
  constexpr bool voltage_usable(std::int32_t voltage_uv, const model::Voltage<S>& predicted_v, const model::Plausible& plausible, std::uint32_t& flags) {
    if (!voltage_present(voltage_uv, plausible, flags)) return false;
    if (voltage_uv != voltage_uv_) {
      voltage_uv_ = voltage_uv;
      repeats_ = 0;
      stuck_ = false;
      predicted_then_v_ = predicted_v;
      return true;
    }
    if (repeats_ < stuck_after) {
      ++repeats_;
      return true;
    }
    const model::Voltage<S> moved_v = predicted_v - predicted_then_v_;
    const auto limit_v = model::Voltage<S>(stuck_move_v);
    if (moved_v > limit_v || moved_v < -limit_v) stuck_ = true;
    if (stuck_) flags |= voltage_stuck;
    return !stuck_;
  }

  static constexpr bool voltage_present(std::int32_t voltage_uv, const model::Plausible& plausible, std::uint32_t& flags) {
    if (voltage_uv == no_reading) {
      flags |= voltage_missing;
    } else if (voltage_uv > plausible.voltage_max_uv || voltage_uv < plausible.voltage_min_uv) {
      flags |= voltage_implausible;
    } else {
      return true;
    }
    return false;
  }

  /// step_us: time since the previous sample, > 0.
  constexpr bool gap(std::uint64_t step_us, std::uint32_t& flags) {
    const bool gap = usual_step_us_ != 0 && step_us > usual_step_us_ * gap_factor;
    usual_step_us_ = step_us;
    if (gap) flags |= time_gap;
    return gap;
  }

 private:
  std::uint64_t usual_step_us_ = 0;
  std::int32_t current_ua_ = 0;
  std::int32_t voltage_uv_ = no_reading;
  model::Voltage<S> predicted_then_v_{};
  std::uint8_t repeats_ = 0;
  bool stuck_ = false;
};

}  // namespace bms
