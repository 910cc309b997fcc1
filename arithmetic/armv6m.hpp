// Back end for ARMv6-M (Cortex-M0, M0+), whose multiplier gives 32 bits and which has no barrel shifter operand. The
// functions that a step calls most are in assembler: the compiler needs far more instructions with eight low registers.
// Each gives the bits of its counterpart in portable.hpp; tests/arithmetic compares the portable ones with real
// numbers, and the replay on the emulated board compares the bits of both.
//
// Included by backend.hpp only.
#pragma once

#include <cstdint>

#include "arithmetic/portable.hpp"

// Functions that are called from many places: inline they would only make the code larger.
#define BMS_CALLED [[gnu::noinline, gnu::const]]

namespace bms::arithmetic::backend {

inline constexpr bool present = true;

/// 32 x 32 -> 64 bit product of four 16-bit products, in 24 instructions; the library's, 64 x 64 bit, needs 60.
/// Source: H. S. Warren, "Hacker's Delight", 2nd edition, section 8-2.
BMS_CALLED constexpr std::int64_t wide_product(std::int32_t a, std::int32_t b) {
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

template <int shift, int bits>
[[gnu::noinline, gnu::const]] inline std::int32_t far_out(std::int32_t high, std::uint32_t low) {
  return portable::rounded<shift, bits>(
      static_cast<std::int64_t>(static_cast<std::uint64_t>(static_cast<std::uint32_t>(high)) << 32 | low));
}

/// Rounded product from four 16-bit products, for 17 <= shift <= 31. The lowest 16 bits of the product are not needed;
/// the carry of the last bit shifted out rounds. Results beyond half of the range are left to far_out().
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

/// portable::rounded() of the product a * b, for the shifts that the assembler covers. of: bits of a and of b, at most.
template <int shift, int bits>
inline constexpr bool has_rounded_product = shift >= 17 && shift <= 31 && bits + shift >= 33;
template <int shift, int bits, int of>
inline std::int32_t rounded_product(std::int32_t a, std::int32_t b) {
  if constexpr (of <= 30 && bits + shift >= 49)
    return rounded_by_short_halves<shift, bits, of>(a, b);
  else
    return rounded_by_halves<shift, bits>(a, b);
}

// Packed numbers: mantissa and exponent of the operands in r0, r1 and r2, r3; of the result in r0, r1. An addition of a
// number to itself sets V when the number has one bit too many.

using portable::Packed;

/// The cases that the assembler leaves to the compiler.
[[gnu::used]] inline Packed rarely_normalised(std::int32_t m, std::int32_t e) asm("bms_scaled_rarely_normalised");
inline Packed rarely_normalised(std::int32_t m, std::int32_t e) { return portable::normalised(m, e); }

[[gnu::const]] Packed product(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be);
[[gnu::const]] Packed sum(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be);
[[gnu::const]] Packed normalised(std::int32_t m, std::int32_t e);

// Both middle products have room in one word: 2 * 2^14 (2^16 - 1) < 2^31.
[[gnu::naked]] inline Packed product(std::int32_t, std::int32_t, std::int32_t, std::int32_t) {
  asm(".syntax unified\n"
      "adds r1, r3\n"
      "adds r1, #29\n"
      "mov ip, r1\n"
      "uxth r1, r0\n"
      "asrs r0, r0, #16\n"
      "uxth r3, r2\n"
      "asrs r2, r2, #16\n"
      "muls r3, r0\n"
      "muls r1, r2\n"
      "muls r0, r2\n"
      "adds r1, r3\n"
      "asrs r1, r1, #13\n"
      "lsls r0, r0, #3\n"
      "adds r0, r1\n"
      "mov r1, ip\n"
      "adds r3, r0, r0\n"
      "bvs 1f\n"
      "negs r3, r3\n"
      "bvs 1f\n"
      "bx lr\n"
      "1: asrs r0, r0, #1\n"
      "adds r1, #1\n"
      "adds r3, r0, r0\n"
      "negs r3, r3\n"
      "bvc 2f\n"
      "adds r0, #1\n"
      "2: bx lr\n");
}

[[gnu::naked]] inline Packed sum(std::int32_t, std::int32_t, std::int32_t, std::int32_t) {
  asm(".syntax unified\n"
      "subs r3, r1, r3\n"
      "bge 1f\n"
      "mov ip, r0\n"
      "movs r0, r2\n"
      "mov r2, ip\n"
      "negs r3, r3\n"
      "adds r1, r3\n"
      "1: cmp r3, #30\n"
      "bhi 3f\n"
      "asrs r2, r3\n"  // by 0 leaves the carry, which the comparison has cleared
      "adcs r0, r2\n"
      "adds r2, r0, r0\n"
      "bvs 2f\n"
      "negs r3, r2\n"
      "bvs 2f\n"
      "adds r2, r2\n"
      "bvc 4f\n"
      "3: asrs r2, r1, #10\n"
      "adds r2, #1\n"
      "cmp r2, #1\n"
      "bhi 4f\n"
      "bx lr\n"
      "2: asrs r0, r0, #1\n"  // a bit too many: rounded
      "movs r2, #0\n"
      "adcs r0, r2\n"
      "adds r1, #1\n"
      "adds r2, r0, r0\n"
      "bvc 3b\n"
      "4: push {r4, lr}\n"
      "bl bms_scaled_rarely_normalised\n"
      "pop {r4, pc}\n");
}

[[gnu::naked]] inline Packed normalised(std::int32_t, std::int32_t) {
  asm(".syntax unified\n"
      "asrs r2, r0, #31\n"
      "movs r3, r0\n"
      "eors r3, r2\n"
      "subs r3, r2\n"
      "beq 9f\n"
      "lsrs r2, r3, #30\n"
      "bne 9f\n"
      "lsrs r2, r3, #14\n"
      "bne 1f\n"
      "lsls r3, r3, #16\n"
      "lsls r0, r0, #16\n"
      "subs r1, #16\n"
      "1: lsrs r2, r3, #22\n"
      "bne 2f\n"
      "lsls r3, r3, #8\n"
      "lsls r0, r0, #8\n"
      "subs r1, #8\n"
      "2: lsrs r2, r3, #26\n"
      "bne 3f\n"
      "lsls r3, r3, #4\n"
      "lsls r0, r0, #4\n"
      "subs r1, #4\n"
      "3: lsrs r2, r3, #28\n"
      "bne 4f\n"
      "lsls r3, r3, #2\n"
      "lsls r0, r0, #2\n"
      "subs r1, #2\n"
      "4: lsrs r3, r3, #29\n"
      "bne 5f\n"
      "lsls r0, r0, #1\n"
      "subs r1, #1\n"
      "5: asrs r2, r1, #10\n"
      "adds r2, #1\n"
      "cmp r2, #1\n"
      "bhi 9f\n"
      "bx lr\n"
      "9: push {r4, lr}\n"
      "bl bms_scaled_rarely_normalised\n"
      "pop {r4, pc}\n");
}

}  // namespace bms::arithmetic::backend
