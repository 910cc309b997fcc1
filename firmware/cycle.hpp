// Decides when a cyclic message is due: at the first sample, then every cycle. Time is the time of the samples.
//
// Samples are never exactly on time, and messages leave with samples only. Therefore a message may leave up to half a
// sample period before its planned time, instead of a whole period after it. The planned times keep their distance of
// one cycle, so early and late samples do not add up. A message that is later than half a period restarts them.
#pragma once

#include <algorithm>
#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: sample_period_s

namespace bms::firmware {

class Cycle {
 public:
  /// Returns true if the message is due, and starts the next cycle. Never within half a cycle after the last one. If
  /// the time went back by more than a period, the message is due (unsigned differences).
  constexpr bool due(std::uint32_t now_us, std::uint32_t cycle_us) {
    const std::uint32_t slack_us = std::min(half_period_us, cycle_us / 2);
    const std::uint32_t since_planned_us = now_us - planned_us_ + slack_us;  // >= 0: it left at most slack_us early
    if (once_ && (now_us - sent_us_ < cycle_us / 2 || since_planned_us < cycle_us)) return false;
    planned_us_ = once_ && since_planned_us - cycle_us <= 2 * slack_us ? planned_us_ + cycle_us : now_us;
    sent_us_ = now_us;
    once_ = true;
    return true;
  }
  /// Makes the message due at the next call.
  constexpr void restart() { once_ = false; }

 private:
  static constexpr auto half_period_us = static_cast<std::uint32_t>(0.5e6 * hal::sample_period_s);

  std::uint32_t planned_us_ = 0, sent_us_ = 0;
  bool once_ = false;
};

}  // namespace bms::firmware
