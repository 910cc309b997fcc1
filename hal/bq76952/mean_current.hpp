// Mean current since the previous sample, corrected so that over time its charge equals the charge that the chip
// counts.
//
// The chip updates its counted charge every 250 ms (filter CC1), samples come every 100 ms: the counted charge alone
// would stand still for two or three samples and then jump. CC3, the mean of 67 conversions of 1.5 ms, is at most 100
// ms older than the voltages. But the chip has its own clock, so now and then a mean is lost or read twice. The
// published current is therefore CC3, and the deficit against the counted charge is made up over a minute:
//
//   current = CC3 + deficit / 64 s,    deficit = counted - published charge, updated when the counted charge has moved
//
// The counted charge moved at an unknown time within the last 100 ms; the middle is assumed. At a constant current I
// this is wrong by at most 50 ms, which shifts the current by 0.08 % of I for a while. A step of the current by D
// arrives late; its deficit is made up as well, by at most 0.15 s x D / 64 s = 0.23 % of D for a minute. A deficit of
// more than half a second of full scale, or a gap between two readings, restarts the comparison and is counted, because
// the charge that flowed meanwhile is unknown. Integers only, 48 bytes.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::hal::bq76952 {

class MeanCurrent {
 public:
  /// Charge [uA s] of the chip's counter: in 2^-32 userAh, an hour of a step of the current.
  static constexpr std::int64_t charge_uas(std::int64_t counted, std::int32_t current_step_ua) {
    const std::int64_t step_uas = std::int64_t{3'600} * current_step_ua;
    return (counted >> 32) * step_uas +
           static_cast<std::int64_t>(
               (static_cast<std::uint64_t>(counted) & 0xFFFF'FFFFU) * static_cast<std::uint64_t>(step_uas) >> 32);
  }

  /// Returns the current to publish [uA]. Both readings are of the same time. end_ua: full scale of cc3_ua.
  constexpr std::int32_t update(std::int32_t cc3_ua, std::int64_t counted_uas, std::uint64_t time_us,
                                std::int32_t end_ua) {
    if (!running_ || time_us - time_us_ > max_step_us) return begin(cc3_ua, counted_uas, time_us);
    const auto step_us = static_cast<std::int64_t>(time_us - time_us_);
    time_us_ = time_us;
    const auto current_ua = static_cast<std::int32_t>(cc3_ua + correction_ua_);
    const std::int64_t given = current_ua * step_us;  // uA us
    if (counted_uas != counted_uas_) {
      deficit_uaus_ += (counted_uas - counted_uas_) * 1'000'000;
      counted_uas_ = counted_uas;
      const std::int64_t deficit_then = deficit_uaus_ - given / 2;
      if (comparable_)
        correction_ua_ = deficit_then / time_constant_us;
      else
        deficit_uaus_ = given / 2;  // the comparison begins here
      comparable_ = true;
      const std::int64_t max_deficit_uaus = std::int64_t{end_ua} * 500'000;
      if (deficit_then > max_deficit_uaus || deficit_then < -max_deficit_uaus) {
        ++restarts_;
        running_ = false;
      }
    }
    deficit_uaus_ -= given;
    return current_ua;
  }

  /// Call if there is no reading, or one at the end of the range. The next reading starts a new comparison.
  constexpr void reset() {
    if (running_) ++restarts_;
    running_ = false;
  }

  constexpr std::uint32_t restarts() const { return restarts_; }

 private:
  static constexpr std::int64_t time_constant_us = 64'000'000;
  static constexpr std::uint64_t max_step_us = 500'000;

  constexpr std::int32_t begin(std::int32_t cc3_ua, std::int64_t counted_uas, std::uint64_t time_us) {
    running_ = true;
    comparable_ = false;
    time_us_ = time_us;
    counted_uas_ = counted_uas;
    deficit_uaus_ = correction_ua_ = 0;
    return cc3_ua;
  }

  std::uint64_t time_us_ = 0;
  std::int64_t counted_uas_ = 0, deficit_uaus_ = 0, correction_ua_ = 0;
  std::uint32_t restarts_ = 0;
  bool running_ = false, comparable_ = false;
};

}  // namespace bms::hal::bq76952
