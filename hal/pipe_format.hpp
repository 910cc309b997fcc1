// The records of emulated/can_pipe.cpp, which hil/emulated_link.cpp speaks on the other side:
//
//   record    u32 id, u8 length, u8 of_block, u8 long_id, u8 0, u8 data[8]        little-endian, 16 bytes
//   block     records; of_block: how many of this block are left after this one, 255 at most
//
// A block to the board begins with a record of length `tick`, whose data are the time; an empty block from it is one
// record of length `nothing`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "hal/bytes.hpp"
#include "hal/can.hpp"

namespace bms::hal::pipe {

inline constexpr std::size_t record_size = 16, length_at = 4, of_block_at = 5, long_id_at = 6, data_at = 8,
                             most_records = 128;
inline constexpr std::uint8_t nothing = 0xFF, tick = 0xFE;

/// All but of_block.
constexpr void put(std::span<std::uint8_t> record, const can::Frame& frame) {
  put_bytes(record, 0, frame.id);
  record[length_at] = frame.length;
  record[long_id_at] = frame.long_id ? 1 : 0;
  for (std::size_t k = 0; k < frame.data.size(); ++k) record[data_at + k] = frame.data[k];
}

constexpr can::Frame frame_of(std::span<const std::uint8_t> record) {
  can::Frame frame{get_bytes<std::uint32_t>(record, 0), record[length_at], {}, record[long_id_at] != 0};
  for (std::size_t k = 0; k < frame.data.size(); ++k) frame.data[k] = record[data_at + k];
  return frame;
}

}  // namespace bms::hal::pipe
