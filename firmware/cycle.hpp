// When something that goes out by time is due: at first, then a cycle after it was last, in the samples' own time.
#pragma once

#include <cstdint>

namespace bms::firmware {

class Cycle {
 public:
  /// True: now it is, and from now on counts. Unsigned: a time that went back is due as well.
  constexpr bool due(std::uint32_t now_us, std::uint32_t cycle_us) {
    if (once_ && now_us - at_us_ < cycle_us) return false;
    at_us_ = now_us;
    once_ = true;
    return true;
  }
  /// Due the next time, however short ago it was.
  constexpr void restart() { once_ = false; }

 private:
  std::uint32_t at_us_ = 0;
  bool once_ = false;
};

}  // namespace bms::firmware
