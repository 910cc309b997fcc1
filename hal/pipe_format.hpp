// Record format between emulated/can_pipe.cpp on the board and host_sim/hil/emulated_link.cpp on the host:
//
//   record    u32 id, u8 length, u8 of_block, u8 long_id, u8 0, u8 data[8]        little-endian, 16 bytes
//   block     up to 128 records; of_block: number of records that follow in this block
//
// A block to the board begins with a record of length `tick`, whose data are the time [us]. An empty block from the
// board is one record of length `nothing`.
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

/// Writes all fields except of_block.
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
