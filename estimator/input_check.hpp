// Decides which readings of a sample the filter may use. A reading that fails is flagged and not used; a voltage is
// never invented in its place.
//
//   missing       measurement::no_reading
//   implausible   outside the range that cell and sensor can have (model::PlausibleRange)
//   stuck         the same voltage to the last digit for `stuck_after` samples while the drop over R0 changed by
//                 `stuck_move_v`; accepted again when it changes
//   gap           a time step more than `gap_factor` times the usual one
//
// A current that fails is replaced by the last accepted one. Its uncertainty is then current_unknown_a of the cell
// file. An implausible current that lasts is used, with a flag of its own, unless no such cell could carry it.
//
// Current and voltage are checked in two calls, the voltage after the prediction: the check for a stuck voltage needs
// the model's drop. Checking all of a sample at once before the prediction costs 18 instructions a step.
#pragma once

#include <cstdint>

#include "estimator/estimate.hpp"
#include "measurement/sample.hpp"
#include "model/cell.hpp"

namespace bms::estimator {

/// A current to count with, and whether it was measured.
struct AcceptedCurrent {
  std::int32_t ua;
  bool measured;
};

template <class S>
class InputCheck {
 public:
  static constexpr std::uint8_t stuck_after = 5;  ///< samples
  /// Samples in a row beyond the plausible range, with the same sign, after which a current is used: the limits of the
  /// cell file may be those of another cell.
  static constexpr std::uint8_t lasts_after = 5;
  static constexpr std::uint32_t gap_factor = 10;  ///< times the usual step
  static constexpr double stuck_move_v = 0.02;     ///< far above the step of any ADC, below the effect of any load

  /// Returns the reading, or the last accepted one and a flag.
  constexpr AcceptedCurrent current(std::int32_t current_ua, const model::PlausibleRange& plausible,
                                    std::uint32_t& flags) {
    if (within(current_ua, -plausible.current_max_ua, plausible.current_max_ua)) [[likely]] {
      current_ua_ = current_ua;
      return {current_ua, true};
    }
    if (current_ua_ != beyond) {  // the reading before was accepted
      accepted_ua_ = current_ua_;
      beyond_ = 0;
      current_ua_ = beyond;
    }
    if (lasts_beyond_limits(current_ua, plausible.current_possible_ua)) {
      flags |= current_beyond_limits;
      accepted_ua_ = current_ua;
      return {current_ua, true};
    }
    flags |= current_ua == measurement::no_reading ? current_missing : current_implausible;
    return {accepted_ua_, false};
  }

  /// Returns true if the voltage is present, plausible and not stuck; else sets a flag. drop_v: R0 times the present
  /// current, which a working sensor follows.
  constexpr bool voltage_usable(std::int32_t voltage_uv, const arithmetic::Voltage<S>& drop_v,
                                const model::PlausibleRange& plausible, std::uint32_t& flags) {
    if (!voltage_present(voltage_uv, plausible, flags)) return false;
    if (voltage_uv != voltage_uv_) {
      voltage_uv_ = voltage_uv;
      repeats_ = 0;
      drop_at_change_v_ = drop_v;
      return true;
    }
    if (repeats_ < stuck_after) {
      ++repeats_;
      return true;
    }
    const arithmetic::Voltage<S> moved_v = drop_v - drop_at_change_v_;
    const auto limit_v = arithmetic::Voltage<S>(stuck_move_v);
    if (moved_v > limit_v || moved_v < -limit_v) repeats_ = stuck;
    if (repeats_ == stuck) flags |= voltage_stuck;
    return repeats_ != stuck;
  }

  /// The same without the check for a stuck reading.
  static constexpr bool voltage_present(std::int32_t voltage_uv, const model::PlausibleRange& plausible,
                                        std::uint32_t& flags) {
    if (within(voltage_uv, plausible.voltage_min_uv, plausible.voltage_max_uv)) [[likely]]
      return true;
    flags |= voltage_uv == measurement::no_reading ? voltage_missing : voltage_implausible;
    return false;
  }

  /// Returns true and sets a flag if the step is a gap. step_us: time since the previous sample, > 0. To be called when
  /// the step differs from the one before, or the one before was a gap.
  constexpr bool gap(std::uint32_t step_us, std::uint32_t& flags) {
    if (usual_step_us_ == 0) {
      usual_step_us_ = step_us;
      return false;
    }
    const bool gap = step_us / gap_factor > usual_step_us_;
    // moves towards the present step: steps that stay long become usual after a while
    if (gap)
      usual_step_us_ += usual_step_us_ / 4 + 1;
    else if (step_us > usual_step_us_)
      usual_step_us_ += (step_us - usual_step_us_) / 8;
    else
      usual_step_us_ -= (usual_step_us_ - step_us) / 8;
    if (gap) flags |= time_gap;
    return gap;
  }

 private:
  friend struct LaneAccess;

  /// Counts readings beyond the plausible range: up for a charge, down for a discharge.
  [[gnu::noinline]] constexpr bool lasts_beyond_limits(std::int32_t current_ua, std::int32_t possible_ua) {
    if (!within(current_ua, -possible_ua, possible_ua)) {  // so is a missing one
      beyond_ = 0;
      return false;
    }
    if (current_ua > 0)
      beyond_ = static_cast<std::int8_t>(beyond_ < 0 ? 1 : beyond_ + (beyond_ < lasts_after ? 1 : 0));
    else
      beyond_ = static_cast<std::int8_t>(beyond_ > 0 ? -1 : beyond_ - (beyond_ > -lasts_after ? 1 : 0));
    return beyond_ >= lasts_after || beyond_ <= -lasts_after;
  }

  static constexpr std::uint8_t stuck = 0xFF;
  /// In current_ua_: the last reading was not plausible. So a plausible one resets beyond_ without a store of its own.
  static constexpr std::int32_t beyond = measurement::no_reading;

  static constexpr bool within(std::int32_t value, std::int32_t low, std::int32_t high) {
    return static_cast<std::uint32_t>(value) - static_cast<std::uint32_t>(low) <=
           static_cast<std::uint32_t>(high) - static_cast<std::uint32_t>(low);
  }

  std::uint32_t usual_step_us_ = 0;
  std::int32_t current_ua_ = 0;   ///< last reading if it was plausible, or `beyond`
  std::int32_t accepted_ua_ = 0;  ///< last accepted reading, after an implausible one
  std::int32_t voltage_uv_ = measurement::no_reading;
  arithmetic::Voltage<S> drop_at_change_v_{};
  std::int8_t beyond_ = 0;    ///< currents beyond the plausible range in a row, with their sign
  std::uint8_t repeats_ = 0;  ///< of the same voltage, or `stuck`
};

}  // namespace bms::estimator
