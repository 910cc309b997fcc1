// 32 x 32 -> 64 bit product. A core whose multiplier has 32 bits of result (ARMv6-M) makes it of four 16-bit products
// in 24 instructions; its library, which multiplies 64 by 64 bits, needs 60. The same bits either way.
#pragma once

#include <cstdint>
#include <type_traits>

// What is called from many places on a core without wide products and barrel shifter stays a function there: inline it
// would only be larger.
#if defined(__ARM_ARCH_6M__)
#define BMS_NARROW_CORE 1
#define BMS_CALLED [[gnu::noinline, gnu::const]]
#else
#define BMS_NARROW_CORE 0
#define BMS_CALLED
#endif

namespace bms::arithmetic {

namespace product_detail {

/// By halves: H. S. Warren, "Hacker's Delight", 2nd edition, section 8-2.
BMS_CALLED constexpr std::int64_t by_halves(std::int32_t a, std::int32_t b) {
  const std::int32_t a1 = a >> 16, b1 = b >> 16;
  const auto a0 = static_cast<std::uint32_t>(a & 0xFFFF), b0 = static_cast<std::uint32_t>(b & 0xFFFF);
  const std::uint32_t low = a0 * b0;
  const std::int32_t middle = static_cast<std::int32_t>(static_cast<std::uint32_t>(a1) * b0 + (low >> 16));
  const std::int32_t other =
      static_cast<std::int32_t>(static_cast<std::uint32_t>(b1) * a0 + static_cast<std::uint32_t>(middle & 0xFFFF));
  const std::int32_t high = a1 * b1 + (middle >> 16) + (other >> 16);
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(static_cast<std::uint32_t>(high)) << 32 |
                                   (static_cast<std::uint32_t>(other) << 16 | (low & 0xFFFF)));
}

}  // namespace product_detail

constexpr std::int64_t wide_product(std::int32_t a, std::int32_t b) {
  if constexpr (BMS_NARROW_CORE != 0) {
    if (!std::is_constant_evaluated()) return product_detail::by_halves(a, b);
  }
  return static_cast<std::int64_t>(a) * b;
}

/// a * b without the product of their lower halves, which is below 2^32, and 0 where either number is a multiple of
/// 2^16. Its last 16 bits are 0.
struct UpperPart {
  std::int32_t high;
  std::uint32_t low;
};
constexpr UpperPart upper_product(std::int32_t a, std::int32_t b) {
  const std::int64_t all = static_cast<std::int64_t>(a) * b - static_cast<std::int64_t>(a & 0xFFFF) * (b & 0xFFFF);
  return {static_cast<std::int32_t>(all >> 32), static_cast<std::uint32_t>(all)};
}

namespace product_detail {

template <int shift, int bits>
constexpr std::int32_t rounded(std::int64_t product) {
  constexpr std::int64_t limit = (std::int64_t{1} << bits) - 1;
  const std::int64_t r = shift == 0 ? product : (product >> shift) + (product >> (shift - 1) & 1);
  return static_cast<std::int32_t>(r > limit ? limit : r < -limit ? -limit : r);
}

#if BMS_NARROW_CORE
template <int shift, int bits>
[[gnu::noinline, gnu::const]] inline std::int32_t far_out(std::int32_t high, std::uint32_t low) {
  return rounded<shift, bits>(
      static_cast<std::int64_t>(static_cast<std::uint64_t>(static_cast<std::uint32_t>(high)) << 32 | low));
}

/// rounded_product() by halves, for 17 <= shift <= 31: the lowest 16 bits of the product are not needed, the carry of
/// the last bit shifted out rounds. What is beyond half of the range is left to far_out().
template <int shift, int bits>
[[gnu::noinline, gnu::const]] inline std::int32_t rounded_by_halves(std::int32_t a, std::int32_t b) {
  std::uint32_t low, b0;
  std::int32_t middle;
  asm(".syntax unified\n"
      "uxth %[low], %[a]\n"
      "asrs %[a], %[a], #16\n"
      "uxth %[b0], %[b]\n"
      "asrs %[b], %[b], #16\n"
      "movs %[middle], %[b0]\n"
      "muls %[middle], %[a]\n"
      "muls %[b0], %[low]\n"
      "muls %[low], %[b]\n"
      "muls %[a], %[b]\n"
      "lsrs %[b0], %[b0], #16\n"
      "adds %[middle], %[b0]\n"
      "uxth %[b0], %[middle]\n"
      "adds %[low], %[b0]\n"
      "asrs %[middle], %[middle], #16\n"
      "adds %[a], %[middle]\n"
      "asrs %[middle], %[low], #16\n"
      "adds %[a], %[middle]\n"
      "lsls %[low], %[low], #16\n"
      "lsls %[b], %[a], %[up]\n"
      "lsrs %[b0], %[low], %[down]\n"
      "adcs %[b], %[b0]\n"
      : [a] "+l"(a), [b] "+l"(b), [low] "=&l"(low), [b0] "=&l"(b0), [middle] "=&l"(middle)
      : [up] "i"(32 - shift), [down] "i"(shift)
      : "cc");
  constexpr int unused = bits + shift - 33;
  if (static_cast<std::uint32_t>((unused > 0 ? a >> unused : a) + 1) > 1) [[unlikely]]
    return far_out<shift, bits>(a, low);
  return b;
}

/// The same of numbers of at most 30 bits: both middle products and what the low one carries have room in 32 bits,
/// since 2 * (2^14 - 1) (2^16 - 1) + 2^16 < 2^31. The middle, below 2^47, does not lead out of the range where that is
/// 2^49 or more; where it is as long as the product, nothing does.
template <int shift, int bits, int of>
[[gnu::noinline, gnu::const]] inline std::int32_t rounded_by_short_halves(std::int32_t a, std::int32_t b) {
  std::uint32_t low, b0;
  std::int32_t middle;
  asm(".syntax unified\n"
      "uxth %[low], %[a]\n"
      "asrs %[a], %[a], #16\n"
      "uxth %[b0], %[b]\n"
      "asrs %[b], %[b], #16\n"
      "movs %[middle], %[b0]\n"
      "muls %[middle], %[a]\n"
      "muls %[b0], %[low]\n"
      "muls %[low], %[b]\n"
      "muls %[a], %[b]\n"
      "lsrs %[b0], %[b0], #16\n"
      "adds %[middle], %[low]\n"
      "adds %[middle], %[b0]\n"
      "lsls %[b], %[a], %[up]\n"
      "asrs %[b0], %[middle], %[down]\n"
      "adcs %[b], %[b0]\n"
      : [a] "+l"(a), [b] "+l"(b), [low] "=&l"(low), [b0] "=&l"(b0), [middle] "=&l"(middle)
      : [up] "i"(32 - shift), [down] "i"(shift - 16)
      : "cc");
  if constexpr (2 * of > bits + shift) {
    constexpr int unused = bits + shift - 33;
    if (static_cast<std::uint32_t>((a >> unused) + 1) > 1) [[unlikely]]
      return far_out<shift, bits>(a + (middle >> 16), static_cast<std::uint32_t>(middle) << 16);
  }
  return b;
}
#endif

}  // namespace product_detail

/// a * b * 2^-shift, rounded to nearest (ties up), held within +-(2^bits - 1). of: the bits that a, and b, have at
/// most.
template <int shift, int bits, int of = 32>
constexpr std::int32_t rounded_product(std::int32_t a, std::int32_t b) {
#if BMS_NARROW_CORE
  if constexpr (shift >= 17 && shift <= 31 && bits + shift >= 33) {
    if (!std::is_constant_evaluated()) {
      if constexpr (of <= 30 && bits + shift >= 49)
        return product_detail::rounded_by_short_halves<shift, bits, of>(a, b);
      else
        return product_detail::rounded_by_halves<shift, bits>(a, b);
    }
  }
#endif
  return product_detail::rounded<shift, bits>(wide_product(a, b));
}

}  // namespace bms::arithmetic
