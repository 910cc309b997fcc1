// Finds out whether a current sensor reads only its own offset: while the circuit is open, the reading is the offset.
//
// A reading rests if a load ended in one step, and the reading then stays within `still_ua` for one minute and is small
// enough to be an offset. A current that slides into this range is the tail of a charge at constant voltage; one that
// steps within it was switched on: an offset does neither.
//
// The cell file says what may still flow at rest (noise.current_at_rest_a: leakage of a cell tester, a vehicle's
// electronics in parallel to an open contactor). If this value is 0, it is unknown, and small currents are taken as
// they are.
#pragma once

#include <cstdint>

#include "model/cell.hpp"

namespace bms::estimator {

class CurrentAtRest {
 public:
  static constexpr std::uint32_t min_rest_us = 60'000'000;
  /// The current that flows at rest is constant for so long: it counts as one measurement.
  static constexpr std::uint32_t correlation_s = 600;

  /// To be called with every measured current. Returns true if it rests. The first reading may rest.
  constexpr bool is_at_rest(std::int32_t current_ua, std::uint64_t step_us, const model::RestingCurrent& limits) {
    const auto largest = static_cast<std::uint32_t>(limits.largest_ua);
    if (static_cast<std::uint32_t>(current_ua) + largest > 2 * largest) [[likely]] {
      level_ua_ = current_ua;
      rest_us_ = loaded;
      return false;
    }
    const bool still = distance(current_ua, level_ua_) <= static_cast<std::uint32_t>(limits.still_ua);
    if (rest_us_ == loaded) {
      level_ua_ = current_ua;
      rest_us_ = still ? flows : 1;
      return false;
    }
    if (rest_us_ == unknown) {
      level_ua_ = current_ua;
      rest_us_ = 1;
      return false;
    }
    if (!still) rest_us_ = flows;
    if (rest_us_ == flows) return false;
    if (rest_us_ < min_rest_us) rest_us_ += step_us < min_rest_us ? static_cast<std::uint32_t>(step_us) : min_rest_us;
    return rest_us_ >= min_rest_us;
  }
  /// After a missing reading.
  constexpr void reset() { rest_us_ = unknown; }

 private:
  static constexpr std::uint32_t unknown = 0, loaded = 0xFFFFFFFF, flows = 0xFFFFFFFE;

  static constexpr std::uint32_t distance(std::int32_t a, std::int32_t b) {
    return a > b ? static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b)
                 : static_cast<std::uint32_t>(b) - static_cast<std::uint32_t>(a);
  }

  std::int32_t level_ua_ = 0;        ///< of the last load, or at the start of the rest
  std::uint32_t rest_us_ = unknown;  ///< duration of the rest, or why the current does not rest
};

}  // namespace bms::estimator
