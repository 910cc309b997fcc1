// Lines of the log in flash (log.hpp): fields of a header, the mark of an erased sector, reading and verified writing.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/bytes.hpp"
#include "hal/flash.hpp"
#include "storage/crc32.hpp"
#include "storage/log.hpp"

namespace bms::storage {

using Line = std::array<std::uint8_t, line_bytes>;

inline constexpr std::uint8_t copy_bit = 0x80;  ///< in the type field: a copy made by a move
/// Of a header: bytes 0 to 7 are the identity (number, type, layout, length); then both checks.
inline constexpr std::size_t identity_bytes = 8, commit_at = 8, check_at = 12;

/// Lines of a record with its header.
constexpr std::uint16_t lines_of(std::size_t payload_bytes) {
  return static_cast<std::uint16_t>(1 + (payload_bytes + line_bytes - 1) / line_bytes);
}

inline Line read_line(std::uint8_t sector, std::uint32_t line) {
  Line bytes;
  hal::flash_read(sector, line * line_bytes, bytes);
  return bytes;
}

/// Line 0 of a sector that was completely erased.
inline Line mark_line() {
  constexpr std::uint32_t erased_mark = 0x44534552, format = 1;  // "RESD"
  Line bytes{};
  hal::put_bytes(bytes, 0, erased_mark);
  hal::put_bytes(bytes, 4, format);
  hal::put_bytes(bytes, 12, crc32(std::span(bytes).first(12)));
  return bytes;
}

/// Programs whole words, the last one filled with ones, and reads them back. Returns false if they differ.
inline bool program_and_verify(std::uint8_t sector, std::uint32_t at, std::span<const std::uint8_t> bytes) {
  for (std::size_t k = 0; k < bytes.size(); k += 4) {
    const std::size_t n = std::min<std::size_t>(4, bytes.size() - k);
    std::uint32_t word = 0xFFFFFFFF;
    for (std::size_t j = 0; j < n; ++j)
      word = (word & ~(0xFFU << (8 * j))) | static_cast<std::uint32_t>(bytes[k + j]) << (8 * j);
    if (!hal::flash_program(sector, at + static_cast<std::uint32_t>(k), word)) return false;
  }
  for (std::size_t k = 0; k < bytes.size();) {
    Line back;
    const std::size_t n = std::min<std::size_t>(back.size(), bytes.size() - k);
    hal::flash_read(sector, at + static_cast<std::uint32_t>(k), std::span(back).first(n));
    if (!std::ranges::equal(std::span(back).first(n), bytes.subspan(k, n))) return false;
    k += n;
  }
  return true;
}

}  // namespace bms::storage
