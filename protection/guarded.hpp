// A word that detects flipped bits. It is stored three times: unchanged, inverted, and xored with a pattern. Any one or
// two flipped bits in the three copies leave at least two copies that contradict each other.
//
// Cost: three stores to set, two comparisons to check.
#pragma once

#include <cstdint>

namespace bms::protection {

class Guarded {
 public:
  constexpr explicit Guarded(std::uint32_t value) { set(value); }
  constexpr void set(std::uint32_t value) {
    value_ = value;
    inverted_ = ~value;
    pattern_ = value ^ xor_pattern;
  }
  constexpr std::uint32_t value() const { return value_; }  ///< valid only while intact()
  constexpr bool intact() const { return value_ == ~inverted_ && value_ == (pattern_ ^ xor_pattern); }
  /// Bits that are set in any of the three copies.
  constexpr std::uint32_t any() const { return value_ | ~inverted_ | (pattern_ ^ xor_pattern); }

 private:
  static constexpr std::uint32_t xor_pattern = 0x5A3C'96A5;
  std::uint32_t value_, inverted_, pattern_;
};

}  // namespace bms::protection
