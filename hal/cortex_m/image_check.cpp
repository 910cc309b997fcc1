#include "hal/cortex_m/image_check.hpp"

#include <array>
#include <cstdint>

extern "C" {
// defined by the linker script
extern const std::uint8_t image_vectors[], image_vectors_end[], image_code_begin[], image_code_end[], image_data_load[],
    image_data_begin[], image_data_end[];
}

namespace bms::hal::cortex_m {

namespace {

/// cmake/image_check.py writes it after linking; volatile, because the compiler sees another value.
struct Check {
  std::uint32_t crc, inverse;
};
[[gnu::section(".image_check"), gnu::used]] constinit const volatile Check check{0xFFFF'FFFF, 0xFFFF'FFFF};

/// CRC-32 of four bits.
constexpr auto table = [] {
  std::array<std::uint32_t, 16> t{};
  for (std::uint32_t k = 0; k < t.size(); ++k) {
    t[k] = k;
    for (int bit = 0; bit < 4; ++bit) t[k] = t[k] >> 1 ^ ((t[k] & 1) != 0 ? 0xEDB8'8320U : 0U);
  }
  return t;
}();

std::uint32_t update_crc(std::uint32_t crc, const std::uint8_t* begin, const std::uint8_t* end) {
  for (const volatile std::uint8_t* at = begin; at < end; ++at) {
    crc ^= *at;
    crc = crc >> 4 ^ table[crc & 15];
    crc = crc >> 4 ^ table[crc & 15];
  }
  return crc;
}

}  // namespace

bool image_intact() {
  std::uint32_t crc = update_crc(0xFFFF'FFFF, image_vectors, image_vectors_end);
  crc = update_crc(crc, image_code_begin, image_code_end);
  crc = ~update_crc(crc, image_data_load, image_data_load + (image_data_end - image_data_begin));
  return crc == check.crc && ~crc == check.inverse;
}

}  // namespace bms::hal::cortex_m
