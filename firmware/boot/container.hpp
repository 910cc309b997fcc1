// The signed container of one image: a header of 2 KiB, then the payload as it stands in flash. Little-endian.
//
//   offset  bytes
//        0      4   magic "BMSI"
//        4      2   format, 1
//        6      1   kind: 1 application, 2 cell constants
//        7      1   slot: 0 A, 1 B; an application is linked for the addresses of this slot
//        8      4   payload bytes
//       12      4   version: major << 16, minor << 8, patch
//       16      4   security version: raised when an older image must not run again
//       20      4   oldest loader that may start it, as a version
//       24      4   flash address of the payload
//       28      4   flags: bit 0 development image
//       32     32   board, the folder in boards/, padded with 0
//       64      4   hash of the cell file (image_cell_hash)
//       68      4   hash of the cell file that the application is built with: of an application the same, of cell
//                   constants that of the only application that may use them
//       72      8   name of the key (crypto.hpp)
//       80      8   release: the same in the containers of one file, and in no other
//       88     40   0
//      128   1792   SHA-256 of each block of 4 KiB of the payload, the last one shorter; unused entries are 0
//     1920     64   0
//     1984     64   ECDSA signature (r, s) of the SHA-256 of the bytes before
//
// One signature covers the header, and through the hashes the payload. So the receiver can refuse an image before it
// writes a byte, and every block as it arrives.
//
// The payload of cell constants has at most one block (firmware/cell_update/format.hpp).
//
// A file of the tool has one or several containers one after the other: the same image for both slots.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "boot/crypto.hpp"
#include "boot/refusal.hpp"
#include "hal/bytes.hpp"

namespace bms::boot {

inline constexpr std::uint32_t header_bytes = 2048, block_bytes = 4096, most_blocks = 56, signed_bytes = 1984,
                               hashes_at = 128, container_magic = 0x49534D42;
inline constexpr std::uint16_t container_format = 1;
inline constexpr std::uint32_t flag_development = 1;
inline constexpr std::size_t board_name_bytes = 32;

enum class Kind : std::uint8_t { application = 1, cell = 2 };

using HeaderBytes = std::array<std::uint8_t, header_bytes>;

struct Header {
  Kind kind = Kind::application;
  std::uint8_t slot = 0;
  std::uint32_t payload_bytes = 0, version = 0, security_version = 0, oldest_loader = 0, address = 0, flags = 0,
                cell_hash = 0, built_for_cell_hash = 0;
  std::array<char, board_name_bytes> board{};
  KeyId key{};
  std::array<std::uint8_t, 8> release{};

  constexpr std::uint32_t blocks() const { return (payload_bytes + block_bytes - 1) / block_bytes; }
  constexpr std::uint32_t block_size(std::uint32_t block) const {
    return std::min(block_bytes, payload_bytes - block * block_bytes);
  }
  constexpr bool development() const { return (flags & flag_development) != 0; }
  std::string_view board_name() const {
    return {board.data(), static_cast<std::size_t>(std::ranges::find(board, '\0') - board.begin())};
  }
};

/// Reads the fields. Returns why the bytes are no header; the signature is checked elsewhere (verify.hpp).
constexpr Refusal read_header(std::span<const std::uint8_t, header_bytes> from, Header& header) {
  using hal::get_bytes;
  if (get_bytes<std::uint32_t>(from, 0) != container_magic || get_bytes<std::uint16_t>(from, 4) != container_format)
    return Refusal::not_a_header;
  header.kind = static_cast<Kind>(from[6]);
  header.slot = from[7];
  header.payload_bytes = get_bytes<std::uint32_t>(from, 8);
  header.version = get_bytes<std::uint32_t>(from, 12);
  header.security_version = get_bytes<std::uint32_t>(from, 16);
  header.oldest_loader = get_bytes<std::uint32_t>(from, 20);
  header.address = get_bytes<std::uint32_t>(from, 24);
  header.flags = get_bytes<std::uint32_t>(from, 28);
  for (std::size_t k = 0; k < header.board.size(); ++k) header.board[k] = static_cast<char>(from[32 + k]);
  header.cell_hash = get_bytes<std::uint32_t>(from, 64);
  header.built_for_cell_hash = get_bytes<std::uint32_t>(from, 68);
  for (std::size_t k = 0; k < header.key.size(); ++k) header.key[k] = from[72 + k];
  for (std::size_t k = 0; k < header.release.size(); ++k) header.release[k] = from[80 + k];
  if (header.kind != Kind::application && header.kind != Kind::cell) return Refusal::header_damaged;
  if (header.slot > 1 || header.board.back() != '\0' || header.payload_bytes == 0) return Refusal::header_damaged;
  if (header.payload_bytes > most_blocks * block_bytes) return Refusal::too_large;
  return Refusal::none;
}

/// Writes everything but the signature.
constexpr void write_header(const Header& header, std::span<const Digest> hashes,
                            std::span<std::uint8_t, header_bytes> to) {
  using hal::put_bytes;
  std::ranges::fill(to, static_cast<std::uint8_t>(0));
  put_bytes(to, 0, container_magic);
  put_bytes(to, 4, container_format);
  to[6] = static_cast<std::uint8_t>(header.kind);
  to[7] = header.slot;
  put_bytes(to, 8, header.payload_bytes);
  put_bytes(to, 12, header.version);
  put_bytes(to, 16, header.security_version);
  put_bytes(to, 20, header.oldest_loader);
  put_bytes(to, 24, header.address);
  put_bytes(to, 28, header.flags);
  for (std::size_t k = 0; k < header.board.size(); ++k) to[32 + k] = static_cast<std::uint8_t>(header.board[k]);
  put_bytes(to, 64, header.cell_hash);
  put_bytes(to, 68, header.built_for_cell_hash);
  for (std::size_t k = 0; k < header.key.size(); ++k) to[72 + k] = header.key[k];
  for (std::size_t k = 0; k < header.release.size(); ++k) to[80 + k] = header.release[k];
  for (std::size_t k = 0; k < hashes.size() && k < most_blocks; ++k)
    std::ranges::copy(hashes[k], to.begin() + static_cast<std::ptrdiff_t>(hashes_at + k * sizeof(Digest)));
}

inline Digest stated_hash(std::span<const std::uint8_t, header_bytes> header, std::uint32_t block) {
  Digest digest{};
  std::ranges::copy(header.subspan(hashes_at + block * sizeof(Digest), sizeof(Digest)), digest.begin());
  return digest;
}

inline Signature stated_signature(std::span<const std::uint8_t, header_bytes> header) {
  Signature signature{};
  std::ranges::copy(header.last<sizeof(Signature)>(), signature.begin());
  return signature;
}

}  // namespace bms::boot
