// A number with 30 significant bits and a power of two of its own, for what spans more decades than fixed point has
// bits: variances, couplings, counts of samples; and for every division and root.
//
//   value = mantissa * 2^exponent       2^29 <= |mantissa| < 2^30, or 0
//
// +, -: rounded to nearest. *: relative error below 2^-26 + 2^-29, exact where a factor is a power of two: the product
// of the lower halves, below 2^32 of at least 2^58, is left out, and the rest is cut to 30 bits. Reciprocal: below
// 2^-27. Root: below 2^-26. Exponents are held within +-1,024 by every sum and conversion: beyond, a number is 0 or
// stays at the end. Products alone let them grow, by as much as a factor's: two million of them one after the other
// would overflow.
//
// Why not float: these are ten to twenty instructions each on a core without FPU, a float's are fifty to a hundred and
// fifty, and carry 24 bits.
#pragma once

#include <array>
#include <bit>
#include <compare>
#include <concepts>
#include <cstdint>

#include "arithmetic/wide_product.hpp"

namespace bms::arithmetic {

template <int I, int F>
class Q;
template <class A, class B>
class Product;
struct PowerOfTwo;

class Scaled {
 public:
  constexpr Scaled() = default;
  constexpr explicit Scaled(int whole) : Scaled(of(static_cast<std::int32_t>(whole), 0)) {}

  /// Constants and host-side conversions, by the bits of the double; what is not finite or below 2^-1000 becomes 0.
  [[gnu::always_inline]] constexpr explicit Scaled(double value) {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    const auto biased = static_cast<std::int32_t>(bits >> 52 & 0x7FF);
    if (biased < 100 || biased == 0x7FF) return;
    const std::uint64_t fraction = (bits & 0xF'FFFF'FFFF'FFFF) | std::uint64_t{1} << 52;
    auto m = static_cast<std::int32_t>((fraction + (std::uint64_t{1} << 22)) >> 23);
    std::int32_t e = biased - 1'052;
    if (m == limit) {
      m >>= 1;
      ++e;
    }
    mantissa_ = bits >> 63 != 0 ? -m : m;
    exponent_ = e;
  }

  template <int I, int F>
  constexpr Scaled(Q<I, F> q)
      : Scaled(of(q.raw(), -F)) {}  // NOLINT(google-explicit-constructor): no digit that counts is lost

  template <class A, class B>
  constexpr Scaled(const Product<A, B>& p)
      : Scaled(Scaled(p.a) * Scaled(p.b)) {}  // NOLINT(google-explicit-constructor)

  template <class A>
  constexpr Scaled(const Product<A, PowerOfTwo>& p)
      : Scaled(of(p.a.raw(), p.b.exponent - A::fraction_bits)) {}  // NOLINT(google-explicit-constructor)
  template <std::same_as<PowerOfTwo> P>
  constexpr Scaled(const P& p) : Scaled(of(std::int32_t{1}, p.exponent)) {}  // NOLINT(google-explicit-constructor)

  /// raw * 2^exponent.
  static constexpr Scaled of(std::int32_t raw, std::int32_t exponent) {
    if (std::is_constant_evaluated() || __builtin_constant_p(raw)) return unpacked(normalised(raw, exponent));
    return unpacked(normalise(raw, exponent));
  }
  static constexpr Scaled of(std::int64_t raw, std::int32_t exponent) {
    if (raw == 0) return {};
    const auto size = static_cast<std::uint64_t>(raw < 0 ? ~raw : raw);
    const int zeros = std::countl_zero(size);  // 1 .. 64
    if (zeros >= 34) return of(static_cast<std::int32_t>(raw), exponent);
    return of(static_cast<std::int32_t>(raw >> (34 - zeros)), exponent + 34 - zeros);
  }

  constexpr std::int32_t mantissa() const { return mantissa_; }
  constexpr std::int32_t exponent() const { return exponent_; }

  constexpr explicit operator double() const {
    double v = mantissa_;
    for (std::int32_t e = exponent_; mantissa_ != 0 && e < 0; ++e) v /= 2;
    for (std::int32_t e = exponent_; mantissa_ != 0 && e > 0; --e) v *= 2;
    return v;
  }

  constexpr Scaled operator-() const {
    Scaled s = *this;
    s.mantissa_ = -s.mantissa_;
    return s;
  }
  friend constexpr Scaled operator+(const Scaled& a, const Scaled& b) {
    return unpacked(sum(a.mantissa_, a.exponent_, b.mantissa_, b.exponent_));
  }
  friend constexpr Scaled operator-(const Scaled& a, const Scaled& b) {
    return unpacked(sum(a.mantissa_, a.exponent_, -b.mantissa_, b.exponent_));
  }
  friend constexpr Scaled operator*(const Scaled& a, const Scaled& b) {
    if (is_one(a)) return b;
    if (is_one(b)) return a;
    return unpacked(product(a.mantissa_, a.exponent_, b.mantissa_, b.exponent_));
  }
  friend constexpr std::strong_ordering operator<=>(const Scaled& a, const Scaled& b) {
    return (a - b).mantissa_ <=> 0;
  }
  friend constexpr bool operator==(const Scaled& a, const Scaled& b) {
    return a.mantissa_ == b.mantissa_ && (a.mantissa_ == 0 || a.exponent_ == b.exponent_);
  }

  /// 1 / x; of 0, the end of the range.
  constexpr Scaled reciprocal() const {
    if (mantissa_ == 0) return unpacked(packed(one_mantissa, highest));
    return unpacked(inverse(mantissa_, exponent_));
  }

  /// 0 for negative numbers.
  constexpr Scaled root() const {
    if (mantissa_ <= 0) return {};
    return unpacked(square_root(mantissa_, exponent_));
  }

  /// In steps of 2^-fraction_bits to the nearest, held within +-end.
  constexpr std::int32_t in_steps(int fraction_bits, std::int32_t end) const {
    return rounded(mantissa_, exponent_ + fraction_bits, end);
  }
  constexpr std::int64_t in_steps(int fraction_bits, std::int64_t end) const {
    const std::int32_t up = exponent_ + fraction_bits;
    if (up < 0) return in_steps(fraction_bits, std::int32_t{0x7FFF'FFFF});
    if (up > 32 || (static_cast<std::int64_t>(mantissa_ < 0 ? -mantissa_ : mantissa_) << up) > end)
      return mantissa_ < 0 ? -end : end;
    return static_cast<std::int64_t>(mantissa_) * (std::int64_t{1} << up);
  }

 private:
  static constexpr std::int32_t limit = std::int32_t{1} << 30;  ///< of mantissas
  static constexpr std::int32_t one_mantissa = limit / 2, one_exponent = -29;
  static constexpr std::int32_t lowest = -1'024, highest = 1'023, of_zero = -100'000;

  // two words in one: such a number comes back from a function in registers
  using Packed = std::uint64_t;
  static constexpr Packed packed(std::int32_t m, std::int32_t e) {
    return static_cast<Packed>(static_cast<std::uint32_t>(e)) << 32 | static_cast<std::uint32_t>(m);
  }
  static constexpr Scaled unpacked(Packed p) {
    Scaled s;
    s.mantissa_ = static_cast<std::int32_t>(static_cast<std::uint32_t>(p));
    s.exponent_ = static_cast<std::int32_t>(static_cast<std::uint32_t>(p >> 32));
    return s;
  }

  /// Known to be 1 when this is compiled: what a product by it would give is saved.
  static constexpr bool is_one(const Scaled& s) {
    return __builtin_constant_p(s.mantissa_) && __builtin_constant_p(s.exponent_) && s.mantissa_ == one_mantissa &&
           s.exponent_ == one_exponent;
  }

  static constexpr std::uint32_t size_of(std::int32_t m) {
    return static_cast<std::uint32_t>((m ^ (m >> 31)) - (m >> 31));
  }

  /// Of a number that is one bit too long or up to all too short.
  static constexpr Packed normalised(std::int32_t m, std::int32_t e) {
    if (m == 0) return packed(0, of_zero);
    const int up = std::countl_zero(size_of(m)) - 2;
    if (up >= 0) return saturated(static_cast<std::int32_t>(static_cast<std::uint32_t>(m) << up), e - up);
    // 31 bits; a carry into the 31st is exact: all below is 0
    const std::int32_t half = (m >> 1) + (m & 1);
    return half == limit ? saturated(half >> 1, e + 2) : saturated(half, e + 1);
  }

  // The three that a step calls most, in assembler where the compiler finds no way through eight registers; elsewhere
  // as written below.
#if BMS_NARROW_CORE
  [[gnu::const]] static Packed normalise_here(std::int32_t m, std::int32_t e);
  [[gnu::const]] static Packed sum_here(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be);
  [[gnu::const]] static Packed product_here(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be);
  [[gnu::used]] static Packed rarely_normalised(std::int32_t m, std::int32_t e) asm("bms_scaled_rarely_normalised");
#endif
  static constexpr Packed normalise(std::int32_t m, std::int32_t e) {
#if BMS_NARROW_CORE
    if (!std::is_constant_evaluated()) return normalise_here(m, e);
#endif
    return normalised(m, e);
  }
  static constexpr Packed sum(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
#if BMS_NARROW_CORE
    if (!std::is_constant_evaluated()) return sum_here(am, ae, bm, be);
#endif
    return sum_of(am, ae, bm, be);
  }
  static constexpr Packed product(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
#if BMS_NARROW_CORE
    if (!std::is_constant_evaluated()) return product_here(am, ae, bm, be);
#endif
    return product_of(am, ae, bm, be);
  }

  static constexpr Packed saturated(std::int32_t m, std::int32_t e) {
    if (static_cast<std::uint32_t>(e - lowest) <= static_cast<std::uint32_t>(highest - lowest)) [[likely]]
      return packed(m, e);
    return e < lowest ? packed(0, of_zero) : packed(m, highest);
  }

  static constexpr Packed sum_of(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
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

  static constexpr Packed product_of(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
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

  /// Reciprocals of (k + 128.5) / 256 in steps of 2^-15.
  static constexpr std::array<std::uint16_t, 128> seeds = [] {
    std::array<std::uint16_t, 128> all{};
    for (std::uint32_t k = 0; k < 128; ++k)
      all[k] = static_cast<std::uint16_t>((16'777'216 + (2 * k + 257) / 2) / (2 * k + 257));
    return all;
  }();

  /// Two Newton steps x += x (1 - m x), in products of 32 bits: what they leave out above is known to be 1.
  BMS_CALLED static constexpr Packed inverse(std::int32_t signed_m, std::int32_t e) {
    const auto m = static_cast<std::uint32_t>(signed_m < 0 ? -signed_m : signed_m);
    std::int32_t x = seeds[(m >> 22) - 128];                                                  // 2^-15; 8 bits are right
    const auto off = static_cast<std::int32_t>(-((m >> 8) * static_cast<std::uint32_t>(x)));  // of 2^37
    x += (x * (off >> 14) + (1 << 22)) >> 23;                                                 // 15 bits
    const auto left = static_cast<std::int32_t>(-(m * static_cast<std::uint32_t>(x)));        // of 2^45
    std::int32_t inverse_m =
        (x << 14) + ((x * (left >> 16)) >> 15) + 2;  // 2^-29, in the middle of its error: not below 1
    std::int32_t inverse_e = -59 - e;
    if (inverse_m >= limit) {
      inverse_m = one_mantissa;
      ++inverse_e;
    }
    return packed(signed_m < 0 ? -inverse_m : inverse_m, inverse_e);
  }

  /// 1 / sqrt((k + 64.5) / 256) in steps of 2^-15.
  static constexpr std::array<std::uint16_t, 192> root_seeds = [] {
    std::array<std::uint16_t, 192> all{};
    for (std::uint32_t k = 0; k < 192; ++k) {
      // the largest y with y^2 (2 k + 129) / 512 <= 2^30
      const std::uint64_t square = (std::uint64_t{1} << 39) / (2 * k + 129);
      std::uint64_t y = 0;
      for (std::uint64_t bit = 1 << 16; bit != 0; bit >>= 1) {
        if ((y + bit) * (y + bit) <= square) y += bit;
      }
      all[k] = static_cast<std::uint16_t>(y > 65'535 ? 65'535 : y);
    }
    return all;
  }();

  /// One Newton step for y = 1 / sqrt(v), v in 1/4 .. 1; then s = v y, corrected by half of what v - s^2 leaves over s.
  BMS_CALLED static constexpr Packed square_root(std::int32_t m, std::int32_t e) {
    const bool odd = (e & 1) != 0;
    const std::uint32_t v = static_cast<std::uint32_t>(m) << (odd ? 1 : 2);  // 2^-32
    std::uint32_t y = root_seeds[(v >> 24) - 64];                            // 2^-15
    const std::uint32_t nearly_1 = (v >> 16) * ((y * y) >> 16) >> 15;        // v y^2, 2^-15
    y = (y * ((std::uint32_t{3} << 15) - nearly_1) + 0x8000) >> 16;
    std::uint32_t s = ((v >> 16) * y + 0x4000) >> 15;  // 2^-16
    if (s > 0xFFFF) s = 0xFFFF;
    const auto left = static_cast<std::int32_t>(v - s * s);
    const std::int32_t root =
        static_cast<std::int32_t>(s << 14) + ((((left + 16) >> 5) * static_cast<std::int32_t>(y)) >> 13);  // 2^-30
    const std::int32_t root_e = (odd ? e + 31 : e + 30) / 2 - 30;
    return normalised(root, root_e);
  }

  BMS_CALLED static constexpr std::int32_t rounded(std::int32_t m, std::int32_t up, std::int32_t end) {
    if (up > 0) {
      const std::int32_t most = up > 30 ? 0 : end >> up;
      if (m > most) return end;
      if (m < -most) return -end;
      return m << (up > 30 ? 0 : up);
    }
    if (up < -31) return 0;
    const std::int32_t r = up == 0 ? m : ((m >> (-up - 1)) + 1) >> 1;
    return r > end ? end : r < -end ? -end : r;
  }

  std::int32_t mantissa_ = 0, exponent_ = of_zero;
};

#if BMS_NARROW_CORE
// Mantissa and exponent of the operands in r0, r1 and r2, r3; of the result in r0, r1. An addition of a number to
// itself sets V when the number has a bit too many.

inline Scaled::Packed Scaled::rarely_normalised(std::int32_t m, std::int32_t e) { return normalised(m, e); }

// Both middle products have room in one word: 2 * 2^14 (2^16 - 1) < 2^31.
[[gnu::naked]] inline Scaled::Packed Scaled::product_here(std::int32_t, std::int32_t, std::int32_t, std::int32_t) {
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

[[gnu::naked]] inline Scaled::Packed Scaled::sum_here(std::int32_t, std::int32_t, std::int32_t, std::int32_t) {
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

[[gnu::naked]] inline Scaled::Packed Scaled::normalise_here(std::int32_t, std::int32_t) {
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
#endif

}  // namespace bms::arithmetic
