#include "boot/verify.hpp"

namespace bms::boot {

namespace {

const TrustedKey* find_key(const Battery& battery, const KeyId& id) {
  for (const TrustedKey& key : battery.keys) {
    if (key_id(key.point) == id) return &key;
  }
  return nullptr;
}

}  // namespace

Refusal check_fields(const Header& header, const Battery& battery, std::uint8_t slot) {
  if (header.kind != battery.kind) return Refusal::other_kind;
  if (header.board_name() != battery.board) return Refusal::other_board;
  if (header.payload_bytes > battery.slot_bytes - header_bytes) return Refusal::too_large;
  if (header.kind == Kind::cell && header.payload_bytes > block_bytes) return Refusal::too_large;
  if (header.kind == Kind::cell && header.built_for_cell_hash != battery.cell_hash) return Refusal::other_cell_file;
  if (header.slot != slot) return Refusal::other_slot;
  if (header.development() && battery.product) return Refusal::development_image;
  if (header.security_version < battery.security_counter) return Refusal::older_security;
  if (header.oldest_loader > battery.loader_version) return Refusal::newer_loader_needed;
  return Refusal::none;
}

Refusal check_fields_and_key(std::span<const std::uint8_t, header_bytes> bytes, const Battery& battery,
                             std::uint8_t slot, Header& header) {
  if (const Refusal r = read_header(bytes, header); r != Refusal::none) return r;
  if (const Refusal r = check_fields(header, battery, slot); r != Refusal::none) return r;
  const TrustedKey* const key = find_key(battery, header.key);
  if (key == nullptr) return Refusal::unknown_key;
  if (key->revoked) return Refusal::revoked_key;
  // A development key signs development images only, so that no leaked one makes a product's image.
  if (key->development && (!header.development() || battery.product)) return Refusal::development_image;
  return Refusal::none;
}

Refusal check_header(std::span<const std::uint8_t, header_bytes> bytes, const Battery& battery, std::uint8_t slot,
                     Header& header) {
  if (const Refusal r = check_fields_and_key(bytes, battery, slot, header); r != Refusal::none) return r;
  const TrustedKey* const key = find_key(battery, header.key);
  if (!signature_right(key->point, sha256(bytes.first<signed_bytes>()), stated_signature(bytes)))
    return Refusal::bad_signature;
  return Refusal::none;
}

}  // namespace bms::boot
