// Owners of OpenSSL's objects.
#pragma once

#include <openssl/evp.h>

#include <memory>

namespace bms::update {

/// Deleter of a std::unique_ptr by a function of OpenSSL.
template <auto Free>
struct Freed {
  template <class T>
  void operator()(T* p) const {
    Free(p);
  }
};
using Pkey = std::unique_ptr<EVP_PKEY, Freed<EVP_PKEY_free>>;

}  // namespace bms::update
