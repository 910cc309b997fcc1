// The mean current since the previous sample, and in the long run the very charge that the chip has counted.
//
// The chip adds up charge every 250 ms (its filter CC1), samples come every 100: the counted charge alone stands still
// for two or three samples and then jumps. CC3, the mean of 67 conversions of 1.5 ms, is at most 100 ms older than the
// voltages, but the chip's clock is not this one: now and then a mean is lost or read twice. So the current is CC3, and
// what the charge given out so far lacks of the counted charge is made up for over a minute:
//
//   current = CC3 + lack / 64 s,    lack = counted - given, looked at when the counted charge has moved
//
// When in the last 100 ms it moved is not known: the middle is taken. With a constant current I that is off by 50 ms at
// most, which shifts the current by 0.08 % of I for a while. What a step of the current by D comes late is made up for,
// too: by up to 0.15 s x D / 64 s = 0.23 % of D, a minute long. A lack of more than half a second of full scale, or a
// gap between two readings, begins anew and is counted: what flowed then is not known. Integers only, 48 bytes.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::hal::bq76952 {

class MeanCurrent {
 public:
  /// counted: 2^-32 of charge_step. Both of one time.
  constexpr std::int32_t update(std::int32_t cc3_ua, std::int64_t counted, std::uint64_t time_us) {
    const std::int64_t counted_uas = charge_uas(counted);
    if (!running_ || time_us - time_us_ > longest_step_us) return begin(cc3_ua, counted_uas, time_us);
    const auto step_us = static_cast<std::int64_t>(time_us - time_us_);
    time_us_ = time_us;
    const auto current_ua = static_cast<std::int32_t>(cc3_ua + making_up_ua_);
    const std::int64_t given = current_ua * step_us;  // uA us
    if (counted_uas != counted_uas_) {
      lack_uaus_ += (counted_uas - counted_uas_) * 1'000'000;
      counted_uas_ = counted_uas;
      const std::int64_t lack_then = lack_uaus_ - given / 2;
      if (known_)
        making_up_ua_ = lack_then / time_constant_us;
      else
        lack_uaus_ = given / 2;  // where the two begin to be compared
      known_ = true;
      if (lack_then > most_lack_uaus || lack_then < -most_lack_uaus) {
        ++restarts_;
        running_ = false;
      }
    }
    lack_uaus_ -= given;
    return current_ua;
  }

  /// No reading: the next one begins anew.
  constexpr void lose() {
    if (running_) ++restarts_;
    running_ = false;
  }

  constexpr std::uint32_t restarts() const { return restarts_; }

 private:
  static constexpr std::int64_t time_constant_us = 64'000'000;
  static constexpr std::uint64_t longest_step_us = 500'000;
  static constexpr std::int64_t most_lack_uaus = 327'000'000LL * 500'000;

  static constexpr std::int64_t charge_uas(std::int64_t counted) {
    constexpr std::int64_t step_uas = 36'000'000;
    return (counted >> 32) * step_uas +
           static_cast<std::int64_t>(
               (static_cast<std::uint64_t>(counted) & 0xFFFF'FFFFU) * static_cast<std::uint64_t>(step_uas) >> 32);
  }

  constexpr std::int32_t begin(std::int32_t cc3_ua, std::int64_t counted_uas, std::uint64_t time_us) {
    running_ = true;
    known_ = false;
    time_us_ = time_us;
    counted_uas_ = counted_uas;
    lack_uaus_ = making_up_ua_ = 0;
    return cc3_ua;
  }

  std::uint64_t time_us_ = 0;
  std::int64_t counted_uas_ = 0, lack_uaus_ = 0, making_up_ua_ = 0;
  std::uint32_t restarts_ = 0;
  bool running_ = false, known_ = false;
};

}  // namespace bms::hal::bq76952
