// A private key that signs images, and public keys: P-256, by OpenSSL.
#pragma once

#include <memory>
#include <string>

#include "boot/crypto.hpp"

namespace bms::update {

/// A private key in a file (PEM) or in a device: "org.openssl.engine:pkcs11:pkcs11:token=...;object=..." needs Debian's
/// libengine-pkcs11-openssl. OpenSSL asks for a pass phrase or PIN on the terminal.
class SigningKey {
 public:
  /// Throws BadInput if there is no such key, or if it is not of the curve P-256.
  explicit SigningKey(const std::string& file_or_uri);
  ~SigningKey();
  SigningKey(const SigningKey&) = delete;
  SigningKey& operator=(const SigningKey&) = delete;

  boot::PublicKey public_key() const;
  boot::Signature sign(const boot::Digest& digest) const;

 private:
  struct Key;
  std::unique_ptr<Key> key_;
};

/// Makes a key and writes it as PEM, readable for its owner only. Throws BadInput if the file exists.
void make_key(const std::string& path);

/// A public key from a PEM file, of a public or of a private key. Throws BadInput.
boot::PublicKey read_public_key(const std::string& path);
/// The public key as PEM.
std::string public_pem(const SigningKey& key);

}  // namespace bms::update
