// The operations under fixed point (fixed.hpp) and scaled numbers (scaled.hpp), in C++ that every core runs: rounded
// products, and sums and products of numbers that are packed as mantissa and exponent. A back end (backend.hpp) may
// have faster functions for a core; they give the same bits.
#pragma once

#include <bit>
#include <cstdint>

namespace bms::arithmetic {

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

/// x limited to -most .. most; most >= 0.
template <class T>
[[gnu::always_inline]] constexpr T clamped(T x, T most) {
  if (x > most) return most;
  return x < -most ? T(-most) : x;
}

namespace portable {

/// product * 2^-shift, rounded to nearest (ties up), clamped to +-(2^bits - 1).
template <int shift, int bits>
constexpr std::int32_t rounded(std::int64_t product) {
  constexpr std::int64_t limit = (std::int64_t{1} << bits) - 1;
  const std::int64_t r = shift == 0 ? product : (product >> shift) + (product >> (shift - 1) & 1);
  return static_cast<std::int32_t>(clamped(r, limit));
}

// Numbers with a power of two of their own: value = mantissa * 2^exponent, 2^29 <= |mantissa| < 2^30, or 0.

/// Exponent and mantissa in one word, so that such a number is returned in registers.
using Packed = std::uint64_t;
constexpr Packed packed(std::int32_t m, std::int32_t e) {
  return static_cast<Packed>(static_cast<std::uint32_t>(e)) << 32 | static_cast<std::uint32_t>(m);
}

inline constexpr std::int32_t limit = std::int32_t{1} << 30;     ///< of mantissas
inline constexpr std::int32_t lowest = -1'024, highest = 1'023;  ///< exponents after a sum or a conversion
inline constexpr std::int32_t of_zero = -100'000;                ///< exponent of 0

/// |m|, m > -2^31.
constexpr std::uint32_t size_of(std::int32_t m) { return static_cast<std::uint32_t>((m ^ (m >> 31)) - (m >> 31)); }

/// Packs a mantissa of 30 bits; an exponent above the range becomes its end, below it the number becomes 0.
constexpr Packed saturated(std::int32_t m, std::int32_t e) {
  if (static_cast<std::uint32_t>(e - lowest) <= static_cast<std::uint32_t>(highest - lowest)) [[likely]]
    return packed(m, e);
  return e < lowest ? packed(0, of_zero) : packed(m, highest);
}

/// Packs a mantissa of any length: at most one bit too long.
constexpr Packed normalised(std::int32_t m, std::int32_t e) {
  if (m == 0) return packed(0, of_zero);
  const int up = std::countl_zero(size_of(m)) - 2;
  if (up >= 0) return saturated(static_cast<std::int32_t>(static_cast<std::uint32_t>(m) << up), e - up);
  // 31 bits; a carry into the 31st is exact: all below is 0
  const std::int32_t half = (m >> 1) + (m & 1);
  return half == limit ? saturated(half >> 1, e + 2) : saturated(half, e + 1);
}

/// Sum of two packed numbers, rounded to nearest.
constexpr Packed sum_of(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
  std::int32_t apart = ae - be;
  if (apart < 0) {
    const std::int32_t m = am;
    am = bm;
    bm = m;
    ae = be;
    apart = -apart;
  }
  if (apart > 30) return saturated(am, ae);
  bm = ((bm >> apart) + (apart > 0 ? bm >> (apart - 1) & 1 : 0));
  const std::int32_t m = am + bm;
  if (size_of(m) >> 29 == 1) [[likely]]
    return saturated(m, ae);
  return normalised(m, ae);
}

/// Product of two packed numbers. Relative error below 2^-26 + 2^-29.
constexpr Packed product_of(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
  const auto [high, below] = upper_product(am, bm);  // 2^26 <= |high| < 2^28
  auto m = static_cast<std::int32_t>(static_cast<std::uint32_t>(high) << 3 | below >> 29);
  std::int32_t e = ae + be + 29;
  if (m >= limit || m <= -limit) {
    m >>= 1;
    if (m == -limit) ++m;  // rounded down from above
    ++e;
  }
  return packed(m, e);
}

}  // namespace portable

}  // namespace bms::arithmetic
