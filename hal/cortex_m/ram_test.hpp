// March test of the RAM, word by word: March C- of van de Goor ("Testing Semiconductor Memories", 1991). Per word and
// background it makes 10 accesses. It finds stuck bits, bits that cannot rise or fall, bits that follow another word's
// bits, and address faults (one address for two words, or for none).
//
//   up(w0) up(r0, w1) up(r1, w0) down(r0, w1) down(r1, w0) up(r0)      0: the background, 1: its inverse
//
// Two backgrounds, 0 and 0x55555555, cover neighbouring bits within a word. The test destroys the content, so it runs
// at start-up before there are data, and excludes RAM that has to survive a reset. It uses registers only, because the
// stack may be under test.
//
// Cost: about 130 instructions per word; the 12 KiB of an image take 25 ms at the 16 MHz of the start (measured:
// boards/porting.md).
#pragma once

#include <cstdint>

namespace bms::hal::cortex_m {

/// Returns false if a word of [begin, end) does not store what is written. Afterwards the range contains 0.
[[gnu::always_inline]] inline bool ram_passes(volatile std::uint32_t* begin, volatile std::uint32_t* end) {
  bool good = true;
  for (int run = 0; run < 2; ++run) {
    const std::uint32_t zero = run == 0 ? 0x5555'5555 : 0, one = ~zero;  // 0 last, because this content remains
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
