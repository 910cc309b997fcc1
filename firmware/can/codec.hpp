// Packs values into the bits of a CAN frame (little-endian) and adds the end-to-end protection. The messages that use
// it are generated from the DBC files (cmake/dbc_header.py).
//
// Arithmetic is float; a signal of more than 24 bits is an integer. NaN is sent as the invalid value of the signal.
// Values outside the range of the signal are clamped.
#pragma once

#include <algorithm>
#include <concepts>
#include <cstdint>
#include <limits>

#include "can/frame.hpp"

namespace bms::can {

inline constexpr float unknown = std::numeric_limits<float>::quiet_NaN();

struct SignalLayout {
  unsigned start, bits;
  bool is_signed;
  /// minus_offset: a core without an FPU then needs no routine that subtracts, 0.8 KB of the flash.
  float factor, minus_offset, lowest, highest;
  bool has_invalid;
  std::int32_t invalid;  ///< raw
};

/// Name of a raw value, for people.
struct ValueName {
  std::int32_t raw;
  const char* text;
};

constexpr std::uint64_t mask(unsigned bits) { return bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1; }

constexpr std::uint64_t bits_of(const Frame& frame) {
  std::uint64_t all = 0;
  for (unsigned k = 0; k < 8; ++k) all |= static_cast<std::uint64_t>(frame.data[k]) << (8 * k);
  return all;
}
constexpr void set_bits(Frame& frame, std::uint64_t all) {
  for (unsigned k = 0; k < 8; ++k) frame.data[k] = static_cast<std::uint8_t>(all >> (8 * k));
}
/// bits: at most 32. Out of line, as put_float(): an image has some 150 signals.
[[gnu::noinline]] constexpr void put_raw(Frame& frame, unsigned start, unsigned bits, std::uint32_t raw) {
  set_bits(frame, (bits_of(frame) & ~(mask(bits) << start)) | ((raw & mask(bits)) << start));
}
constexpr std::uint64_t get_raw(const Frame& frame, unsigned start, unsigned bits) {
  return (bits_of(frame) >> start) & mask(bits);
}

/// Not-a-number becomes `lowest`.
constexpr float clamped(float value, float lowest, float highest) {
  if (!(value > lowest)) return lowest;
  return value > highest ? highest : value;
}

// put() writes the value of a signal, get() reads it. Types: the one that cmake/dbc_header.py chooses.

[[gnu::noinline]] constexpr void put_float(Frame& frame, const SignalLayout& s, float value) {
  std::int32_t raw = s.invalid;
  if (value == value || !s.has_invalid) {
    const float counts = (clamped(value, s.lowest, s.highest) + s.minus_offset) / s.factor;
    raw = static_cast<std::int32_t>(counts + (counts < 0 ? -0.5F : 0.5F));
  }
  put_raw(frame, s.start, s.bits, static_cast<std::uint32_t>(raw));
}
template <SignalLayout s>
constexpr void put(Frame& frame, float value) {
  put_float(frame, s, value);
}
template <SignalLayout s>
constexpr void put(Frame& frame, std::uint32_t value) {
  constexpr auto most = s.bits > 24 ? static_cast<std::uint32_t>(mask(s.bits)) : static_cast<std::uint32_t>(s.highest);
  constexpr std::uint32_t if_above = s.has_invalid ? static_cast<std::uint32_t>(s.invalid) : most;
  put_raw(frame, s.start, s.bits, value <= most ? value : if_above);
}

template <SignalLayout s>
constexpr void put(Frame& frame, std::int32_t value) {
  constexpr auto most = static_cast<std::int32_t>(mask(s.bits - 1));
  const std::int32_t sent = std::clamp<std::int32_t>(value, -most - 1, most);
  put_raw(frame, s.start, s.bits, static_cast<std::uint32_t>(sent));
}

template <SignalLayout s>
constexpr std::int64_t value_of(const Frame& frame) {
  const std::uint64_t raw = get_raw(frame, s.start, s.bits);
  const auto value = static_cast<std::int64_t>(raw);
  return s.is_signed && (raw >> (s.bits - 1) & 1) != 0 ? value - static_cast<std::int64_t>(mask(s.bits)) - 1 : value;
}
template <SignalLayout s, std::same_as<float> T>
constexpr float get(const Frame& frame) {
  const std::int64_t value = value_of<s>(frame);
  if (s.has_invalid && value == s.invalid) return unknown;
  return static_cast<float>(static_cast<std::int32_t>(value)) * s.factor - s.minus_offset;
}
template <SignalLayout s, std::same_as<std::uint32_t> T>
constexpr std::uint32_t get(const Frame& frame) {
  return static_cast<std::uint32_t>(get_raw(frame, s.start, s.bits));
}
template <SignalLayout s, std::same_as<std::int32_t> T>
constexpr std::int32_t get(const Frame& frame) {
  return static_cast<std::int32_t>(value_of<s>(frame));
}

// AUTOSAR end-to-end protection, profile 1. Byte 0: CRC-8 SAE J1850 (polynomial 0x1D, initial value 0, no inversion)
// over the data id, low byte first, and bytes 1 to 7. Low half of byte 1: a counter from 0 to 14. It reveals corrupted,
// repeated, lost and mistaken frames.

inline constexpr std::uint8_t counters = 15;  ///< values of the counter

constexpr std::uint8_t crc8(std::uint8_t crc, std::uint8_t byte) {
  crc = static_cast<std::uint8_t>(crc ^ byte);
  for (int k = 0; k < 8; ++k) crc = static_cast<std::uint8_t>((crc << 1) ^ ((crc & 0x80) != 0 ? 0x1D : 0));
  return crc;
}
constexpr std::uint8_t crc_of(const Frame& frame, std::uint16_t data_id) {
  std::uint8_t crc = crc8(crc8(0, static_cast<std::uint8_t>(data_id & 0xFF)), static_cast<std::uint8_t>(data_id >> 8));
  for (unsigned k = 1; k < frame.length; ++k) crc = crc8(crc, frame.data[k]);
  return crc;
}
constexpr void protect(Frame& frame, std::uint16_t data_id, std::uint8_t counter) {
  put_raw(frame, 8, 4, counter);
  frame.data[0] = crc_of(frame, data_id);
}
/// Returns true if length and CRC are right.
constexpr bool intact(const Frame& frame, std::uint16_t data_id) {
  return frame.length == 8 && frame.data[0] == crc_of(frame, data_id);
}
constexpr std::uint8_t counter_of(const Frame& frame) { return frame.data[1] & 0x0F; }
/// Counter of the next frame.
constexpr std::uint8_t next(std::uint8_t counter) {
  return counter + 1 < counters ? static_cast<std::uint8_t>(counter + 1) : std::uint8_t{0};
}

}  // namespace bms::can
