// A word that detects flipped bits. It is stored three times: unchanged, inverted, and xored with a pattern. Any one or
// two flipped bits in the three copies leave at least two copies that contradict each other.
//
// Cost: three stores to set, two comparisons to check.
#pragma once

#include <cstdint>

namespace bms::protection {

/// Word: an unsigned type of 32 or 64 bits.
template <class Word>
class GuardedWord {
 public:
  constexpr explicit GuardedWord(Word value) { set(value); }
  constexpr void set(Word value) {
    value_ = value;
    inverted_ = ~value;
    pattern_ = value ^ xor_pattern;
  }
  constexpr Word value() const { return value_; }  ///< valid only while intact()
  constexpr bool intact() const { return value_ == ~inverted_ && value_ == (pattern_ ^ xor_pattern); }
  /// Bits that are set in any of the three copies.
  constexpr Word any() const { return value_ | ~inverted_ | (pattern_ ^ xor_pattern); }

 private:
  static constexpr auto xor_pattern = static_cast<Word>(0x5A3C'96A5'5A3C'96A5);
  Word value_, inverted_, pattern_;
};

using Guarded = GuardedWord<std::uint32_t>;

}  // namespace bms::protection
