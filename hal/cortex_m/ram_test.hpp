// A march through RAM, word by word: C- of van de Goor ("Testing Semiconductor Memories", 1991), 10 accesses a word and
// background, which finds bits that are stuck, that do not go up or down, that follow another word's, and addresses
// that are two words' or none's.
//
//   up(w0) up(r0, w1) up(r1, w0) down(r0, w1) down(r1, w0) up(r0)      0: the background, 1: its inverse
//
// Two backgrounds, 0 and 0x55555555, for neighbours within a word. Destroys what it tests, so at start-up only, before
// there are data, and what a reset is to leave alone is left out. Uses registers alone: the stack may be what it tests.
//
// Cost: some 130 instructions a word; the 12 KiB that an image uses, 25 ms at the 16 MHz of the start
// (boards/porting.md has them measured).
#pragma once

#include <cstdint>

namespace bms::hal::cortex_m {

/// False: some word of [begin, end) does not hold what is written. The range is all 0 afterwards, if it can be.
[[gnu::always_inline]] inline bool ram_passes(volatile std::uint32_t* begin, volatile std::uint32_t* end) {
  bool good = true;
  for (int run = 0; run < 2; ++run) {
    const std::uint32_t zero = run == 0 ? 0x5555'5555 : 0, one = ~zero;  // 0 last: that is left
    for (auto* at = begin; at < end; ++at) *at = zero;
    for (auto* at = begin; at < end; ++at) {
      good = *at == zero && good;
      *at = one;
    }
    for (auto* at = begin; at < end; ++at) {
      good = *at == one && good;
      *at = zero;
    }
    for (auto* at = end; at > begin;) {
      good = *--at == zero && good;
      *at = one;
    }
    for (auto* at = end; at > begin;) {
      good = *--at == one && good;
      *at = zero;
    }
    for (auto* at = begin; at < end; ++at) good = *at == zero && good;
  }
  return good;
}

}  // namespace bms::hal::cortex_m
