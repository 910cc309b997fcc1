// Finds out whether a current sensor reads only its own offset: while the circuit is open, the reading is the offset.
//
// A reading rests if it stays within `still_ua` of its start for one minute and is small enough to be an offset. The
// cell file says what may still flow then (noise.current_at_rest_a: leakage of a cell tester, a vehicle's electronics
// in parallel to an open contactor). If this value is 0, it is unknown, and small currents are taken as they are.
#pragma once

#include <cstdint>

#include "model/cell.hpp"

namespace bms::estimator {

class CurrentAtRest {
 public:
  static constexpr std::uint32_t min_rest_us = 60'000'000;
  /// The current that flows at rest is constant for so long: it counts as one measurement.
  static constexpr std::uint32_t correlation_s = 600;

  /// To be called with every measured current. Returns true if it rests.
  constexpr bool is_at_rest(std::int32_t current_ua, std::uint64_t step_us, const model::RestingCurrent& limits) {
    const bool small = current_ua <= limits.largest_ua && current_ua >= -limits.largest_ua;
    const bool still = small && rest_us_ != 0 && current_ua - start_ua_ <= limits.still_ua &&
                       start_ua_ - current_ua <= limits.still_ua;
    if (!still) {
      start_ua_ = current_ua;
      rest_us_ = small ? 1 : 0;
      return false;
    }
    if (rest_us_ < min_rest_us) rest_us_ += step_us < min_rest_us ? static_cast<std::uint32_t>(step_us) : min_rest_us;
    return rest_us_ >= min_rest_us;
  }
  constexpr void reset() { rest_us_ = 0; }

 private:
  std::int32_t start_ua_ = 0;
  std::uint32_t rest_us_ = 0;  ///< 0: the current moves
};

}  // namespace bms::estimator
