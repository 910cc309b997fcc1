// Products of 32 x 32 bits, exact or rounded. The same bits on every core, by the core's back end where it has one; a
// constant expression always takes the portable way.
#pragma once

#include <cstdint>
#include <type_traits>

#include "arithmetic/backend.hpp"

namespace bms::arithmetic {

/// a * b, exact.
constexpr std::int64_t wide_product(std::int32_t a, std::int32_t b) {
  if constexpr (backend::present) {
    if (!std::is_constant_evaluated()) return backend::wide_product(a, b);
  }
  return static_cast<std::int64_t>(a) * b;
}

/// a * b * 2^-shift, rounded to nearest (ties up), clamped to +-(2^bits - 1). of: the bits that a, and b, have at most.
template <int shift, int bits, int of = 32>
constexpr std::int32_t rounded_product(std::int32_t a, std::int32_t b) {
  if constexpr (backend::has_rounded_product<shift, bits>) {
    if (!std::is_constant_evaluated()) return backend::rounded_product<shift, bits, of>(a, b);
  }
  return portable::rounded<shift, bits>(wide_product(a, b));
}

}  // namespace bms::arithmetic
