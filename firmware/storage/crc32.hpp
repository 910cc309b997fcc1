// CRC-32 of IEEE 802.3 (polynomial 0x04C11DB7, reflected, initial value and final xor all ones), four bits per step,
// with a table of 64 bytes.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace bms::storage {

class Crc32 {
 public:
  /// Adds bytes; may be called several times.
  constexpr Crc32& add(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) {
      sum_ = table[(sum_ ^ byte) & 15U] ^ sum_ >> 4;
      sum_ = table[(sum_ ^ static_cast<std::uint32_t>(byte >> 4)) & 15U] ^ sum_ >> 4;
    }
    return *this;
  }
  constexpr std::uint32_t value() const { return ~sum_; }

 private:
  static constexpr std::array<std::uint32_t, 16> table = []() {
    std::array<std::uint32_t, 16> t{};
    for (std::uint32_t k = 0; k < t.size(); ++k) {
      std::uint32_t sum = k;
      for (int bit = 0; bit < 4; ++bit) sum = (sum & 1U) != 0 ? sum >> 1 ^ 0xEDB88320U : sum >> 1;
      t[k] = sum;
    }
    return t;
  }();

  std::uint32_t sum_ = 0xFFFFFFFF;
};

constexpr std::uint32_t crc32(std::span<const std::uint8_t> bytes) { return Crc32().add(bytes).value(); }

}  // namespace bms::storage
