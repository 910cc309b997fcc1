// AES-128, encryption of one block (NIST FIPS 197). Reference form: one table, which is computed at compile time, and
// the round keys one after the other, so that 32 bytes of stack are enough.
//
// The table is read at places that depend on the key. On a controller whose table lies in flash behind a cache, the
// time of a run depends on them a little. An attacker would have to measure 1 us on a wire, while the
// answers leave with the samples, 100 ms apart (docs/safety/threats.md).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace bms::authentication {

using Block = std::array<std::uint8_t, 16>;
using Key = Block;

namespace aes {

/// x times 2 in GF(2^8) modulo x^8 + x^4 + x^3 + x + 1 (4.2).
constexpr std::uint8_t doubled(std::uint8_t x) {
  return static_cast<std::uint8_t>((x << 1) ^ ((x & 0x80) != 0 ? 0x1B : 0));
}

/// The S-box (5.1.1): the inverse in GF(2^8), then an affine map. p runs through all elements, q through their
/// inverses: 3 generates the field.
constexpr std::array<std::uint8_t, 256> make_s_box() {
  std::array<std::uint8_t, 256> box{};
  const auto rotated = [](std::uint8_t x, int by) { return static_cast<std::uint8_t>((x << by) | (x >> (8 - by))); };
  std::uint8_t p = 1, q = 1;
  do {
    p = static_cast<std::uint8_t>(p ^ doubled(p));  // times 3
    q = static_cast<std::uint8_t>(q ^ (q << 1));    // divided by 3
    q = static_cast<std::uint8_t>(q ^ (q << 2));
    q = static_cast<std::uint8_t>(q ^ (q << 4));
    if ((q & 0x80) != 0) q ^= 0x09;
    box[p] = static_cast<std::uint8_t>(q ^ rotated(q, 1) ^ rotated(q, 2) ^ rotated(q, 3) ^ rotated(q, 4) ^ 0x63);
  } while (p != 1);
  box[0] = 0x63;
  return box;
}
inline constexpr std::array<std::uint8_t, 256> s_box = make_s_box();

/// The next round key in place (5.2).
constexpr void expand(Block& key, std::uint8_t& round_constant) {
  for (std::size_t k = 0; k < 4; ++k) key[k] = static_cast<std::uint8_t>(key[k] ^ s_box[key[12 + (k + 1) % 4]]);
  key[0] ^= round_constant;
  round_constant = doubled(round_constant);
  for (std::size_t k = 4; k < 16; ++k) key[k] ^= key[k - 4];
}

constexpr void add(Block& state, const Block& key) {
  for (std::size_t k = 0; k < 16; ++k) state[k] ^= key[k];
}

/// SubBytes and ShiftRows (5.1.1, 5.1.2); the state is stored column by column.
constexpr Block substituted_and_shifted(const Block& state) {
  Block out{};
  for (std::size_t k = 0; k < 16; ++k) out[k] = s_box[state[(k + 4 * (k % 4)) % 16]];
  return out;
}

/// MixColumns (5.1.3).
constexpr void mix_columns(Block& state) {
  for (std::size_t c = 0; c < 16; c += 4) {
    const std::uint8_t first = state[c],
                       all = static_cast<std::uint8_t>(state[c] ^ state[c + 1] ^ state[c + 2] ^ state[c + 3]);
    for (std::size_t k = 0; k < 4; ++k) {
      const std::uint8_t next = k == 3 ? first : state[c + k + 1];
      state[c + k] =
          static_cast<std::uint8_t>(state[c + k] ^ all ^ doubled(static_cast<std::uint8_t>(state[c + k] ^ next)));
    }
  }
}

}  // namespace aes

/// The cipher block of `state` under `key`.
[[gnu::noinline]] constexpr Block encrypted(Block state, Key key) {
  constexpr int rounds = 10;
  std::uint8_t round_constant = 1;
  aes::add(state, key);
  for (int round = 1; round <= rounds; ++round) {
    state = aes::substituted_and_shifted(state);
    if (round < rounds) aes::mix_columns(state);
    aes::expand(key, round_constant);
    aes::add(state, key);
  }
  return state;
}

}  // namespace bms::authentication
