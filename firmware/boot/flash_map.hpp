// Where loader, stored data and slots lie in the flash of an STM32F405RG: 1 MiB, one bank (RM0090, table 5).
//
//   sector  address      bytes
//        0  0x0800'0000  16 K    loader: vectors, public keys, code
//   1 to 3  0x0800'4000  48 K    stored data (firmware/storage/), untouched by an update
//        4  0x0801'0000  64 K    loader: its code above 16 K, at most 32 K; the rest is empty
//   5 and 6 0x0802'0000  256 K   slot A
//   7 and 8 0x0806'0000  256 K   slot B
//        9  0x080A'0000  128 K   cell constants, slot A
//       10  0x080C'0000  128 K   cell constants, slot B
//       11  0x080E'0000  128 K   free
//
// Sectors 0 and 4 are write-protected by the option bytes.
#pragma once

#include <array>
#include <cstdint>

#include "boot/container.hpp"

namespace bms::boot {

inline constexpr std::uint32_t loader_begin = 0x0800'0000, loader_first_bytes = 16 * 1024,
                               loader_second_begin = 0x0801'0000, loader_second_bytes = 32 * 1024;
inline constexpr std::array<std::uint32_t, 2> application_slots{0x0802'0000, 0x0806'0000},
    cell_slots{0x080A'0000, 0x080C'0000};
inline constexpr std::uint32_t application_slot_bytes = 256 * 1024, cell_slot_bytes = 128 * 1024;

constexpr std::uint32_t slot_begin(Kind kind, std::uint8_t slot) {
  return (kind == Kind::application ? application_slots : cell_slots)[slot];
}
constexpr std::uint32_t slot_bytes(Kind kind) {
  return kind == Kind::application ? application_slot_bytes : cell_slot_bytes;
}
static_assert(slot_begin(Kind::application, 0) + slot_bytes(Kind::application) == slot_begin(Kind::application, 1) &&
              slot_begin(Kind::application, 1) + slot_bytes(Kind::application) == slot_begin(Kind::cell, 0) &&
              slot_begin(Kind::cell, 0) + slot_bytes(Kind::cell) == slot_begin(Kind::cell, 1));

/// Where the payload of a slot begins; its vectors stand there, which need a multiple of 512 (VTOR).
constexpr std::uint32_t payload_address(Kind kind, std::uint8_t slot) { return slot_begin(kind, slot) + header_bytes; }
static_assert(payload_address(Kind::application, 0) % 512 == 0);

}  // namespace bms::boot
