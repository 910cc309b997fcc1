// What a battery accepts: the same check when an image arrives, when its transfer ends, and at every start.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "boot/container.hpp"

namespace bms::boot {

/// A key that the loader contains.
struct TrustedKey {
  PublicKey point{};
  bool development = false;  ///< accepts development images only, and only a development loader has it
  bool revoked = false;      ///< by a bit that cannot be set back (slot_flash.hpp)
};

/// What the application says of cell constants that it is to use.
using ContentCheck = Refusal(std::span<const std::uint8_t> payload);

/// The battery that is to run an image.
struct Battery {
  std::string_view board;
  std::span<const TrustedKey> keys;
  std::uint32_t security_counter = 0;  ///< lowest security version that may run
  std::uint32_t loader_version = 0;
  std::uint32_t slot_bytes = 0;     ///< for header and payload
  bool product = true;              ///< refuses development images
  Kind kind = Kind::application;    ///< what the slot is for
  std::uint32_t cell_hash = 0;      ///< for cell constants: cell file that the application was built with
  ContentCheck* content = nullptr;  ///< before cell constants are written; nullptr: accepts any
};

/// Checks the header: format, board, slot, size, security version, key, signature, in this order, so that the reason is
/// the one that helps most. Returns Refusal::none and the fields, or the reason.
Refusal check_header(std::span<const std::uint8_t, header_bytes> bytes, const Battery& battery, std::uint8_t slot,
                     Header& header);

/// The same without the signature: for an image that leaves it to the loader, which starts nothing without it.
Refusal check_fields_and_key(std::span<const std::uint8_t, header_bytes> bytes, const Battery& battery,
                             std::uint8_t slot, Header& header);
using HeaderCheck = decltype(check_header);

/// The fields only.
Refusal check_fields(const Header& header, const Battery& battery, std::uint8_t slot);

}  // namespace bms::boot
