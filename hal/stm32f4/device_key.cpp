// The device key in block 0 of the one-time programmable memory (RM0090, 3.6.5: 512 bytes from 0x1FFF7800 on). The
// block cannot be erased, and its lock byte (0x1FFF7A00) ends writing.
//
//   bytes 0 to 15    the key
//   bytes 16 to 19   CRC-32 of the key (IEEE 802.3), little-endian
//
// boards/stm32f405_forklift/README.md says how it is written. Read-out protection (RDP) keeps it from a debug probe.
#include "hal/device_key.hpp"

#include "hal/bytes.hpp"

namespace bms::hal {

namespace {

constexpr std::uintptr_t one_time_memory = 0x1FFF'7800;

std::uint32_t crc32_of(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = ~0U;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int k = 0; k < 8; ++k) crc = crc >> 1 ^ ((crc & 1) != 0 ? 0xEDB8'8320U : 0U);
  }
  return ~crc;
}

}  // namespace

std::optional<std::array<std::uint8_t, 16>> device_key() {
  std::array<std::uint8_t, 20> all{};
  for (std::size_t k = 0; k < all.size(); ++k)
    all[k] = *reinterpret_cast<const volatile std::uint8_t*>(one_time_memory + k);
  std::array<std::uint8_t, 16> key{};
  std::uint8_t ones = 0xFF, zeros = 0;
  for (std::size_t k = 0; k < key.size(); ++k) {
    key[k] = all[k];
    ones &= all[k];
    zeros |= all[k];
  }
  if (ones == 0xFF || zeros == 0) return std::nullopt;  // never written
  if (get_bytes<std::uint32_t>(all, key.size()) != crc32_of(key)) return std::nullopt;
  return key;
}

}  // namespace bms::hal
