#include "update/signing_key.hpp"

#include <fcntl.h>
#include <openssl/core_names.h>
#include <openssl/ecdsa.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/store.h>
#include <openssl/ui.h>
#include <unistd.h>

#include <array>
#include <stdexcept>
#include <vector>

#include "files/bad_input.hpp"
#include "files/text_file.hpp"
#include "update/openssl_pointers.hpp"

namespace bms::update {

namespace {

using Memory = std::unique_ptr<BIO, Freed<BIO_free_all>>;

constexpr const char* curve = "prime256v1";

boot::PublicKey point_of(const EVP_PKEY& key, const std::string& name) {
  std::array<char, 32> group{};
  std::array<unsigned char, 65> point{};
  std::size_t size = 0;
  EVP_PKEY_get_utf8_string_param(&key, OSSL_PKEY_PARAM_GROUP_NAME, group.data(), group.size(), nullptr);
  const bool right =
      EVP_PKEY_get_octet_string_param(&key, OSSL_PKEY_PARAM_PUB_KEY, point.data(), point.size(), &size) == 1 &&
      size == point.size() && point[0] == 4 && std::string(group.data()) == curve;
  if (!right) throw files::BadInput(name, 1, "is not a key of the curve P-256, expected one that bms image key makes");
  boot::PublicKey out{};
  std::copy(point.begin() + 1, point.end(), out.begin());
  return out;
}

Pkey load(const std::string& file_or_uri, int expected) {
  OSSL_STORE_CTX* store = OSSL_STORE_open(file_or_uri.c_str(), UI_get_default_method(), nullptr, nullptr, nullptr);
  Pkey key;
  if (store != nullptr) {
    OSSL_STORE_expect(store, expected);
    while (!key && OSSL_STORE_eof(store) == 0) {
      OSSL_STORE_INFO* info = OSSL_STORE_load(store);
      if (info == nullptr) break;
      if (OSSL_STORE_INFO_get_type(info) == OSSL_STORE_INFO_PKEY) key.reset(OSSL_STORE_INFO_get1_PKEY(info));
      if (OSSL_STORE_INFO_get_type(info) == OSSL_STORE_INFO_PUBKEY) key.reset(OSSL_STORE_INFO_get1_PUBKEY(info));
      OSSL_STORE_INFO_free(info);
    }
    OSSL_STORE_close(store);
  }
  return key;
}

}  // namespace

struct SigningKey::Key {
  Pkey key;
  boot::PublicKey point;
};

SigningKey::SigningKey(const std::string& file_or_uri) {
  Pkey key = load(file_or_uri, OSSL_STORE_INFO_PKEY);
  if (!key) throw files::BadInput(file_or_uri, 1, "has no private key, expected a PEM file or an address of PKCS#11");
  const boot::PublicKey point = point_of(*key, file_or_uri);
  key_ = std::make_unique<Key>(Key{std::move(key), point});
}

SigningKey::~SigningKey() = default;

boot::PublicKey SigningKey::public_key() const { return key_->point; }

boot::Signature SigningKey::sign(const boot::Digest& digest) const {
  const std::unique_ptr<EVP_PKEY_CTX, Freed<EVP_PKEY_CTX_free>> c(EVP_PKEY_CTX_new(key_->key.get(), nullptr));
  std::array<unsigned char, 80> der{};
  std::size_t size = der.size();
  if (!c || EVP_PKEY_sign_init(c.get()) != 1 ||
      EVP_PKEY_sign(c.get(), der.data(), &size, digest.data(), digest.size()) != 1)
    throw std::runtime_error("the key did not sign");
  const unsigned char* begin = der.data();
  const std::unique_ptr<ECDSA_SIG, Freed<ECDSA_SIG_free>> pair(d2i_ECDSA_SIG(nullptr, &begin, static_cast<long>(size)));
  boot::Signature signature{};
  if (!pair || BN_bn2binpad(ECDSA_SIG_get0_r(pair.get()), signature.data(), 32) != 32 ||
      BN_bn2binpad(ECDSA_SIG_get0_s(pair.get()), signature.data() + 32, 32) != 32)
    throw std::runtime_error("the signature has an unexpected form");
  return signature;
}

void make_key(const std::string& path) {
  const Pkey key(EVP_EC_gen(curve));
  const Memory memory(BIO_new(BIO_s_mem()));
  if (!key || PEM_write_bio_PrivateKey(memory.get(), key.get(), nullptr, nullptr, 0, nullptr, nullptr) != 1)
    throw std::runtime_error("no key could be made");
  char* text = nullptr;
  const auto size = static_cast<std::size_t>(BIO_get_mem_data(memory.get(), &text));
  const int fd = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0) throw files::BadInput(path, 1, "exists or cannot be written, expected the name of a new file");
  const bool written = write(fd, text, size) == static_cast<ssize_t>(size) && fsync(fd) == 0;
  close(fd);
  if (!written) throw files::BadInput(path, 1, "could not be written");
}

boot::PublicKey read_public_key(const std::string& path) {
  Pkey key = load(path, OSSL_STORE_INFO_PUBKEY);
  if (!key) key = load(path, OSSL_STORE_INFO_PKEY);
  if (!key) throw files::BadInput(path, 1, "has no key, expected a PEM file");
  return point_of(*key, path);
}

std::string public_pem(const SigningKey& key) {
  // SubjectPublicKeyInfo of P-256 (RFC 5480) is this prefix and the point.
  static constexpr std::array<unsigned char, 27> prefix{0x30, 0x59, 0x30, 0x13, 0x06, 0x07, 0x2A, 0x86, 0x48,
                                                        0xCE, 0x3D, 0x02, 0x01, 0x06, 0x08, 0x2A, 0x86, 0x48,
                                                        0xCE, 0x3D, 0x03, 0x01, 0x07, 0x03, 0x42, 0x00, 0x04};
  std::vector<unsigned char> der(prefix.begin(), prefix.end());
  for (const std::uint8_t byte : key.public_key()) der.push_back(byte);
  std::vector<unsigned char> base64(4 * ((der.size() + 2) / 3) + 1);
  EVP_EncodeBlock(base64.data(), der.data(), static_cast<int>(der.size()));
  std::string text(reinterpret_cast<const char*>(base64.data()));
  for (std::size_t at = 64; at < text.size(); at += 65) text.insert(at, "\n");
  return "-----BEGIN PUBLIC KEY-----\n" + text + "\n-----END PUBLIC KEY-----\n";
}

}  // namespace bms::update
