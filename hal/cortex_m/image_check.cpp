#include "hal/cortex_m/image_check.hpp"

#include <array>
#include <cstdint>
#include <iterator>

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

struct Part {
  const std::uint8_t *begin, *end;
};

const std::uint8_t* position = image_vectors;
std::uint32_t part = 0, crc = 0xFFFF'FFFF;
bool intact = true;

}  // namespace

bool image_intact(std::uint32_t bytes) {
  const Part parts[] = {{image_vectors, image_vectors_end},
                        {image_code_begin, image_code_end},
                        {image_data_load, image_data_load + (image_data_end - image_data_begin)}};
  while (true) {
    const std::uint8_t* const end = parts[part].end;
    const auto left = static_cast<std::uint32_t>(end - position);
    if (bytes < left) {
      crc = update_crc(crc, position, position + bytes);
      position += bytes;
      return intact;
    }
    crc = update_crc(crc, position, end);
    bytes -= left;
    const bool last = ++part == std::size(parts);
    if (last) {
      intact = intact && ~crc == check.crc && crc == check.inverse;
      crc = 0xFFFF'FFFF;
      part = 0;
    }
    position = parts[part].begin;
    if (last) return intact;
  }
}

}  // namespace bms::hal::cortex_m
