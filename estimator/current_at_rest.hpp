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
  static constexpr std::uint32_t begins_us = 60'000'000;
  static constexpr std::uint32_t lasts_s = 600;  ///< what flows in a rest is the same for so long: it is told once

  /// With every measured current; true: it rests.
  constexpr bool rests(std::int32_t current_ua, std::uint64_t step_us, const model::RestingCurrent& limits) {
    const bool small = current_ua <= limits.largest_ua && current_ua >= -limits.largest_ua;
    const bool still =
        small && for_us_ != 0 && current_ua - began_ua_ <= limits.still_ua && began_ua_ - current_ua <= limits.still_ua;
    if (!still) {
      began_ua_ = current_ua;
      for_us_ = small ? 1 : 0;
      return false;
    }
    if (for_us_ < begins_us) for_us_ += step_us < begins_us ? static_cast<std::uint32_t>(step_us) : begins_us;
    return for_us_ >= begins_us;
  }
  constexpr void moves() { for_us_ = 0; }

 private:
  std::int32_t began_ua_ = 0;
  std::uint32_t for_us_ = 0;  ///< 0: it moves
};

}  // namespace bms::estimator
