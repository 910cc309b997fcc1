// Whether a current sensor reads nothing but its own offset: while the circuit is open, that is its reading.
//
// A reading rests when for a minute it stays within `still` of where it began and is small enough to be an offset. What
// may still flow then, the cell file says (noise.current_at_rest_a: a cell tester's leakage, a vehicle's electronics
// beside an open contactor); where it says 0, nobody knows, and small currents are believed as they are.
#pragma once

#include <cstdint>

#include "model/cell.hpp"

namespace bms::estimator {

class CurrentAtRest {
 public:
  static constexpr std::uint32_t min_rest_us = 60'000'000;
  static constexpr std::uint32_t correlation_s =
      600;  ///< what flows in a rest is the same for so long: it is told once

  /// With every measured current; true: it rests.
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
  std::uint32_t rest_us_ = 0;  ///< 0: it moves
};

}  // namespace bms::estimator
