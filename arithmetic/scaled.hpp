// A number with 30 significant bits and a power of two of its own, for quantities that span more decades than fixed
// point has bits: variances, couplings, counts of samples; and for every division and root.
//
//   value = mantissa * 2^exponent       2^29 <= |mantissa| < 2^30, or 0
//
//   +, -         rounded to nearest
//   *            relative error below 2^-26 + 2^-29; exact if a factor is a power of two. The product of the lower
//                halves, below 2^32 of at least 2^58, is left out, and the rest is cut to 30 bits
//   reciprocal   relative error below 2^-27
//   root         relative error below 2^-26
//
// Every sum and every conversion limits the exponent to +-1,024: below, a number becomes 0; above, it keeps the largest
// exponent. Products alone may exceed this range, each by at most a factor's exponent: two million products in a row
// would overflow.
//
// Two functions ask the compiler whether a value is a constant (__builtin_constant_p: is_one(), of()). The answer
// depends on compiler, optimisation level and inlining, so the result must not depend on it; else host and board would
// differ. It does not. A product by 1 is exact (1 is a power of two), so leaving it out gives the same bits.
// portable::normalised and the back end's normalised give the same bits for every argument. The question only saves
// instructions.
//
// Why not float: an operation takes ten to twenty instructions on a core without FPU; a float's takes fifty to a
// hundred and fifty and carries 24 bits.
#pragma once

#include <array>
#include <bit>
#include <compare>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "arithmetic/backend.hpp"
#include "arithmetic/portable.hpp"

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

  /// For constants and conversions on the host, from the bits of the double; what is not finite or below 2^-923 becomes
  /// 0.
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
    if (std::is_constant_evaluated() || __builtin_constant_p(raw)) return unpacked(portable::normalised(raw, exponent));
    return unpacked(normalised(raw, exponent));
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

  /// 1 / x; for 0 the end of the range.
  constexpr Scaled reciprocal() const {
    if (mantissa_ == 0) return unpacked(portable::packed(one_mantissa, highest));
    return unpacked(inverse(mantissa_, exponent_));
  }

  /// 0 for negative numbers.
  constexpr Scaled root() const {
    if (mantissa_ <= 0) return {};
    return unpacked(square_root(mantissa_, exponent_));
  }

  /// In steps of 2^-fraction_bits, rounded to nearest, clamped to +-end.
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
  using Packed = portable::Packed;
  static constexpr std::int32_t limit = portable::limit;
  static constexpr std::int32_t one_mantissa = limit / 2, one_exponent = -29;
  static constexpr std::int32_t highest = portable::highest, of_zero = portable::of_zero;

  static constexpr Scaled unpacked(Packed p) {
    Scaled s;
    s.mantissa_ = static_cast<std::int32_t>(static_cast<std::uint32_t>(p));
    s.exponent_ = static_cast<std::int32_t>(static_cast<std::uint32_t>(p >> 32));
    return s;
  }

  /// Returns true if the compiler knows that s is 1; the product by it is then left out (see the top of the file).
  static constexpr bool is_one(const Scaled& s) {
    return __builtin_constant_p(s.mantissa_) && __builtin_constant_p(s.exponent_) && s.mantissa_ == one_mantissa &&
           s.exponent_ == one_exponent;
  }

  // The three operations that a step calls most: by the back end, and in a constant expression the portable way.
  static constexpr Packed normalised(std::int32_t m, std::int32_t e) {
    if constexpr (backend::present) {
      if (!std::is_constant_evaluated()) return backend::normalised(m, e);
    }
    return portable::normalised(m, e);
  }
  static constexpr Packed sum(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
    if constexpr (backend::present) {
      if (!std::is_constant_evaluated()) return backend::sum(am, ae, bm, be);
    }
    return portable::sum_of(am, ae, bm, be);
  }
  static constexpr Packed product(std::int32_t am, std::int32_t ae, std::int32_t bm, std::int32_t be) {
    if constexpr (backend::present) {
      if (!std::is_constant_evaluated()) return backend::product(am, ae, bm, be);
    }
    return portable::product_of(am, ae, bm, be);
  }

  /// Reciprocals of (k + 128.5) / 256 in steps of 2^-15.
  static constexpr std::array<std::uint16_t, 128> seeds = [] {
    std::array<std::uint16_t, 128> all{};
    for (std::uint32_t k = 0; k < 128; ++k)
      all[k] = static_cast<std::uint16_t>((16'777'216 + (2 * k + 257) / 2) / (2 * k + 257));
    return all;
  }();

  /// Two Newton steps x += x (1 - m x), in products of 32 bits: the omitted upper bits are known to be 1.
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
    return portable::packed(signed_m < 0 ? -inverse_m : inverse_m, inverse_e);
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

  /// One Newton step for y = 1 / sqrt(v), v in 1/4 .. 1; then s = v y, corrected by (v - s^2) / (2 s).
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
    return portable::normalised(root, root_e);
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
    return clamped(r, end);
  }

  std::int32_t mantissa_ = 0, exponent_ = of_zero;
};

}  // namespace bms::arithmetic
