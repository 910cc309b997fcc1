// SHA-256 (FIPS 180-4) and the check of ECDSA signatures on the curve P-256 (FIPS 186-4).
// Back ends: crypto_mbedtls.cpp (loader, tests), host_sim/update/crypto_openssl.cpp (tool).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace bms::boot {

using Digest = std::array<std::uint8_t, 32>;
using PublicKey = std::array<std::uint8_t, 64>;  ///< x and y of the point, big-endian
using Signature = std::array<std::uint8_t, 64>;  ///< r and s, big-endian

/// Digest of bytes that come in pieces.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;
  void add(std::span<const std::uint8_t> bytes);
  Digest finish();  ///< ends the calculation

 private:
  alignas(std::uint64_t) std::array<std::uint8_t, 112> state_{};
};

inline Digest sha256(std::span<const std::uint8_t> bytes) {
  Sha256 all;
  all.add(bytes);
  return all.finish();
}

/// Returns false for a point that is not on the curve as well.
bool signature_right(const PublicKey& key, const Digest& digest, const Signature& signature);

/// A key is named by the first eight bytes of its SHA-256.
using KeyId = std::array<std::uint8_t, 8>;
inline KeyId key_id(const PublicKey& key) {
  const Digest digest = sha256(key);
  KeyId id{};
  for (std::size_t k = 0; k < id.size(); ++k) id[k] = digest[k];
  return id;
}

}  // namespace bms::boot
