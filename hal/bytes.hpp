// Little-endian integers in the bytes of a frame.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <span>
#include <type_traits>

namespace bms::hal {

/// Writes the low `size` bytes of `value` to to[at] and following.
template <std::integral T>
constexpr void put_bytes(std::span<std::uint8_t> to, std::size_t at, T value, std::size_t size = sizeof(T)) {
  for (std::size_t k = 0; k < size; ++k)
    to[at + k] = static_cast<std::uint8_t>(static_cast<std::make_unsigned_t<T>>(value) >> (8 * k));
}

/// Reads `size` bytes from from[at] and following; missing high bytes are 0.
template <std::integral T>
constexpr T get_bytes(std::span<const std::uint8_t> from, std::size_t at, std::size_t size = sizeof(T)) {
  std::make_unsigned_t<T> value = 0;
  for (std::size_t k = 0; k < size; ++k)
    value = static_cast<std::make_unsigned_t<T>>(value | static_cast<std::make_unsigned_t<T>>(from[at + k]) << (8 * k));
  return static_cast<T>(value);
}

}  // namespace bms::hal
