// A word that a flipped bit cannot change unnoticed: kept three times, as it is, inverted, and against a pattern. Any
// one or two bits that flip anywhere in the three leave two copies that contradict each other.
//
// Cost: three stores to set, two comparisons to read.
#pragma once

#include <cstdint>

namespace bms::protection {

class Guarded {
 public:
  constexpr explicit Guarded(std::uint32_t value) { set(value); }
  constexpr void set(std::uint32_t value) {
    value_ = value;
    inverted_ = ~value;
    pattern_ = value ^ against;
  }
  constexpr std::uint32_t value() const { return value_; }  ///< good for something only while intact
  constexpr bool intact() const { return value_ == ~inverted_ && value_ == (pattern_ ^ against); }
  constexpr std::uint32_t any() const {
    return value_ | ~inverted_ | (pattern_ ^ against);
  }  ///< bits that any copy has

 private:
  static constexpr std::uint32_t against = 0x5A3C'96A5;
  std::uint32_t value_, inverted_, pattern_;
};

}  // namespace bms::protection
