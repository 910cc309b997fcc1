// AES-CMAC (RFC 4493, NIST SP 800-38B): a code of 16 bytes that only a holder of the key can make.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "authentication/aes128.hpp"

namespace bms::authentication {

class Cmac {
 public:
  constexpr explicit Cmac(const Key& key) : key_(key), whole_(doubled_block(encrypted({}, key))) {}

  constexpr Block operator()(std::span<const std::uint8_t> message) const {
    Block state{};
    for (; message.size() > state.size(); message = message.subspan(state.size())) {
      for (std::size_t k = 0; k < state.size(); ++k) state[k] ^= message[k];
      state = encrypted(state, key_);
    }
    for (std::size_t k = 0; k < message.size(); ++k) state[k] ^= message[k];
    const bool complete = message.size() == state.size();
    if (!complete) state[message.size()] ^= 0x80;
    aes::add(state, complete ? whole_ : doubled_block(whole_));
    return encrypted(state, key_);
  }

 private:
  /// A block times x in GF(2^128), high byte first: the subkeys K1 and K2 (2.3).
  static constexpr Block doubled_block(const Block& block) {
    Block out{};
    for (std::size_t k = 0; k < block.size(); ++k) {
      const int carry = k + 1 < block.size() ? block[k + 1] >> 7 : 0;
      out[k] = static_cast<std::uint8_t>((block[k] << 1) | carry);
    }
    if ((block[0] & 0x80) != 0) out[15] ^= 0x87;
    return out;
  }

  Key key_;
  Block whole_;  ///< K1: added to a last block that is complete
};

/// Compares two codes in a time that does not depend on where they differ.
constexpr bool equal_codes(std::uint32_t a, std::uint32_t b) { return (a ^ b) == 0; }

}  // namespace bms::authentication
