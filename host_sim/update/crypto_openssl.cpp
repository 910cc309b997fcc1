#include <openssl/core_names.h>
#include <openssl/ecdsa.h>
#include <openssl/evp.h>
#include <openssl/param_build.h>

#include <memory>
#include <new>

#include "boot/crypto.hpp"
#include "update/openssl_pointers.hpp"

namespace bms::boot {

namespace {

EVP_MD_CTX*& context(std::array<std::uint8_t, 112>& state) { return *reinterpret_cast<EVP_MD_CTX**>(state.data()); }

using update::Freed;
using Key = update::Pkey;
using KeyContext = std::unique_ptr<EVP_PKEY_CTX, Freed<EVP_PKEY_CTX_free>>;

Key public_key(const PublicKey& point) {
  std::array<unsigned char, 65> bytes{4};  // uncompressed (SEC 1, 2.3.3)
  std::ranges::copy(point, bytes.begin() + 1);
  const KeyContext c(EVP_PKEY_CTX_new_from_name(nullptr, "EC", nullptr));
  char group[] = "prime256v1";
  OSSL_PARAM parameters[] = {OSSL_PARAM_utf8_string(OSSL_PKEY_PARAM_GROUP_NAME, group, 0),
                             OSSL_PARAM_octet_string(OSSL_PKEY_PARAM_PUB_KEY, bytes.data(), bytes.size()),
                             OSSL_PARAM_END};
  EVP_PKEY* key = nullptr;
  if (!c || EVP_PKEY_fromdata_init(c.get()) != 1 ||
      EVP_PKEY_fromdata(c.get(), &key, EVP_PKEY_PUBLIC_KEY, parameters) != 1)
    return nullptr;
  return Key(key);
}

}  // namespace

Sha256::Sha256() {
  new (state_.data()) EVP_MD_CTX*(EVP_MD_CTX_new());
  EVP_DigestInit_ex(context(state_), EVP_sha256(), nullptr);
}

Sha256::~Sha256() { EVP_MD_CTX_free(context(state_)); }

void Sha256::add(std::span<const std::uint8_t> bytes) { EVP_DigestUpdate(context(state_), bytes.data(), bytes.size()); }

Digest Sha256::finish() {
  Digest digest{};
  EVP_DigestFinal_ex(context(state_), digest.data(), nullptr);
  return digest;
}

bool signature_right(const PublicKey& point, const Digest& digest, const Signature& signature) {
  const Key key = public_key(point);
  if (!key) return false;
  const std::unique_ptr<ECDSA_SIG, Freed<ECDSA_SIG_free>> pair(ECDSA_SIG_new());
  ECDSA_SIG_set0(pair.get(), BN_bin2bn(signature.data(), 32, nullptr), BN_bin2bn(signature.data() + 32, 32, nullptr));
  std::array<unsigned char, 80> der{};
  unsigned char* end = der.data();
  const int size = i2d_ECDSA_SIG(pair.get(), &end);
  const KeyContext c(EVP_PKEY_CTX_new(key.get(), nullptr));
  return size > 0 && c && EVP_PKEY_verify_init(c.get()) == 1 &&
         EVP_PKEY_verify(c.get(), der.data(), static_cast<std::size_t>(size), digest.data(), digest.size()) == 1;
}

}  // namespace bms::boot
