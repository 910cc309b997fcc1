#include <mbedtls/ecdsa.h>
#include <mbedtls/memory_buffer_alloc.h>
#include <mbedtls/sha256.h>

#include <new>

#include "boot/crypto.hpp"

namespace bms::boot {

namespace {

/// Of the multiplication; a check that gets no memory refuses.
constexpr std::size_t heap_bytes = 6 * 1024;

struct Curve {
  Curve() {
    mbedtls_ecp_group_init(&group);
    mbedtls_ecp_point_init(&point);
    mbedtls_mpi_init(&r);
    mbedtls_mpi_init(&s);
  }
  ~Curve() {
    mbedtls_mpi_free(&s);
    mbedtls_mpi_free(&r);
    mbedtls_ecp_point_free(&point);
    mbedtls_ecp_group_free(&group);
  }
  Curve(const Curve&) = delete;
  Curve& operator=(const Curve&) = delete;

  mbedtls_ecp_group group;
  mbedtls_ecp_point point;
  mbedtls_mpi r, s;
};

}  // namespace

Sha256::Sha256() {
  static_assert(sizeof(mbedtls_sha256_context) <= sizeof state_ && alignof(mbedtls_sha256_context) <= 8);
  auto* const context = new (state_.data()) mbedtls_sha256_context;
  mbedtls_sha256_init(context);
  mbedtls_sha256_starts_ret(context, 0);
}

Sha256::~Sha256() { mbedtls_sha256_free(reinterpret_cast<mbedtls_sha256_context*>(state_.data())); }

void Sha256::add(std::span<const std::uint8_t> bytes) {
  mbedtls_sha256_update_ret(reinterpret_cast<mbedtls_sha256_context*>(state_.data()), bytes.data(), bytes.size());
}

Digest Sha256::finish() {
  Digest digest{};
  mbedtls_sha256_finish_ret(reinterpret_cast<mbedtls_sha256_context*>(state_.data()), digest.data());
  return digest;
}

bool signature_right(const PublicKey& key, const Digest& digest, const Signature& signature) {
  alignas(std::uint64_t) static std::array<unsigned char, heap_bytes> heap;
  mbedtls_memory_buffer_alloc_init(heap.data(), heap.size());
  bool right = false;
  {
    Curve c;
    std::array<std::uint8_t, 65> point{4};  // uncompressed (SEC 1, 2.3.3)
    for (std::size_t k = 0; k < key.size(); ++k) point[k + 1] = key[k];
    right = mbedtls_ecp_group_load(&c.group, MBEDTLS_ECP_DP_SECP256R1) == 0 &&
            mbedtls_ecp_point_read_binary(&c.group, &c.point, point.data(), point.size()) == 0 &&
            mbedtls_ecp_check_pubkey(&c.group, &c.point) == 0 &&
            mbedtls_mpi_read_binary(&c.r, signature.data(), 32) == 0 &&
            mbedtls_mpi_read_binary(&c.s, signature.data() + 32, 32) == 0 &&
            mbedtls_ecdsa_verify(&c.group, digest.data(), digest.size(), &c.point, &c.r, &c.s) == 0;
  }
  mbedtls_memory_buffer_alloc_free();
  return right;
}

}  // namespace bms::boot
