// A record as firmware/storage/log.hpp describes it, encoded independently, so that tests can write flash without the
// log.
#pragma once

#include <cstdint>
#include <vector>

namespace bms {

/// CRC-32 bit by bit, as IEEE 802.3 defines it.
inline std::uint32_t crc32_by_bits(const std::vector<std::uint8_t>& bytes) {
  std::uint32_t sum = ~0U;
  for (const std::uint8_t byte : bytes) {
    for (int bit = 0; bit < 8; ++bit) {
      const bool out = ((sum ^ static_cast<std::uint32_t>(byte >> bit)) & 1U) != 0;
      sum = sum >> 1 ^ (out ? 0xEDB88320U : 0);
    }
  }
  return ~sum;
}

inline void put(std::vector<std::uint8_t>& to, std::uint32_t value) {
  for (int k = 0; k < 4; ++k) to.push_back(static_cast<std::uint8_t>(value >> (8 * k)));
}

/// Header and payload, filled up to whole lines. number: its low bits are the line in the sector.
inline std::vector<std::uint8_t> record_bytes(std::uint32_t number, std::uint8_t type, std::uint8_t layout,
                                              const std::vector<std::uint8_t>& payload) {
  std::vector<std::uint8_t> bytes;
  put(bytes, number);
  bytes.insert(bytes.end(), {type, layout, static_cast<std::uint8_t>(payload.size()), 0});
  std::vector<std::uint8_t> all = bytes;
  all.insert(all.end(), payload.begin(), payload.end());
  put(bytes, crc32_by_bits(all));
  put(bytes, crc32_by_bits({bytes.begin(), bytes.begin() + 8}));
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  while (bytes.size() % 16 != 0) bytes.push_back(0xFF);
  return bytes;
}

}  // namespace bms
