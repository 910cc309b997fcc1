// The public keys of a battery: the last 512 bytes of sector 0, next to the loader and write-protected with it, so that
// loader and application read the same keys. An entry whose kind is erased holds no key. bms image loader writes them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "boot/slot_flash.hpp"
#include "boot/verify.hpp"

namespace bms::boot {

inline constexpr std::uint32_t key_table_address = 0x0800'3E00, key_entry_bytes = 68, most_keys = 4;
/// One of these stands before the point of a key, little-endian.
inline constexpr std::uint32_t product_key_kind = 0x4B59'5052, development_key_kind = 0x4B59'4456;

class KeyTable {
 public:
  /// bytes: most_keys entries. Keys that the one-time words revoke are marked so.
  KeyTable(std::span<const std::uint8_t> bytes, SlotFlash& flash) {
    for (std::uint32_t k = 0; k < most_keys; ++k) {
      const auto entry = bytes.subspan(k * key_entry_bytes, key_entry_bytes);
      const auto kind = hal::get_bytes<std::uint32_t>(entry, 0);
      if (kind != product_key_kind && kind != development_key_kind) continue;
      TrustedKey& key = keys_[count_++];
      for (std::size_t i = 0; i < key.point.size(); ++i) key.point[i] = entry[4 + i];
      key.development = kind == development_key_kind;
      key.revoked = key_revoked(flash, k);
    }
  }
  std::span<const TrustedKey> keys() const { return std::span(keys_).first(count_); }
  /// A battery with a development key is not a product.
  bool product() const {
    for (const TrustedKey& key : keys()) {
      if (key.development && !key.revoked) return false;
    }
    return true;
  }

 private:
  std::array<TrustedKey, most_keys> keys_{};
  std::size_t count_ = 0;
};

}  // namespace bms::boot
