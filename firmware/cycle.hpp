// Decides when a cyclic message is due: at the first sample, then one cycle after it was last sent. Time is the time of
// the samples.
#pragma once

#include <cstdint>

namespace bms::firmware {

class Cycle {
 public:
  /// Returns true if the message is due, and starts the next cycle. Also due if the time went back (unsigned
  /// difference).
  constexpr bool due(std::uint32_t now_us, std::uint32_t cycle_us) {
    if (once_ && now_us - at_us_ < cycle_us) return false;
    at_us_ = now_us;
    once_ = true;
    return true;
  }
  /// Makes the message due at the next call.
  constexpr void restart() { once_ = false; }

 private:
  std::uint32_t at_us_ = 0;
  bool once_ = false;
};

}  // namespace bms::firmware
