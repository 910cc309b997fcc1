// Fixed-point numbers whose range is part of their type.
//
//   Q<I, F>  holds  -2^I < value < 2^I  in steps of 2^-F,  as int32_t when I + F <= 31, else as int64_t
//
// A sum or a product gets a type wide enough to hold every possible result, so that arithmetic cannot overflow: it would not
// compile. Where 63 bits are not enough, fraction bits are dropped, never integer bits. A value is narrowed only when it is
// stored in a named type (`const Voltage v = r0 * current;`): that conversion rounds to nearest and saturates at the range's
// end. No implicit conversion comes in from or goes out to floating point.
//
// The same integer instructions run on every core, so the bits are equal on host and target. No 128-bit type is needed.
// Source of the notation: Texas Instruments' Qm.n, sign bit not counted.
#pragma once

#include <bit>
#include <compare>
#include <cstdint>
#include <type_traits>

namespace bms::model {

template <int I, int F>
class Q;

template <class T>
inline constexpr bool is_q = false;
template <int I, int F>
inline constexpr bool is_q<Q<I, F>> = true;

namespace fixed_detail {

/// v * 2^shift without overflow checks when shift >= 0; rounded to nearest (ties up) when shift < 0.
constexpr std::int64_t shifted(std::int64_t v, int shift) {
  if (shift >= 0) return static_cast<std::int64_t>(static_cast<std::uint64_t>(v) << shift);
  if (shift <= -63) return 0;
  const std::int64_t half = std::int64_t{1} << (-shift - 1);
  // v + half may leave the range by one bit only when v is within half of the end; shift first, then add the carried bit
  return (v >> -shift) + ((v & (half * 2 - 1)) >= half ? 1 : 0);
}

/// v * 2^shift, held inside +-limit.
constexpr std::int64_t saturated_shift(std::int64_t v, int shift, std::int64_t limit) {
  if (shift > 0) {
    const std::int64_t room = limit >> shift;
    if (v > room) return limit;
    if (v < -room) return -limit;
  }
  const std::int64_t r = shifted(v, shift);
  return r > limit ? limit : r < -limit ? -limit : r;
}

/// a * b * 2^-drop, rounded towards minus infinity, for 64 x 32 bit; the caller's types promise that the result fits.
constexpr std::int64_t wide_product(std::int64_t a, std::int32_t b, int drop) {
  const std::int64_t high = (a >> 32) * b;                                      // |.| < 2^62
  const std::int64_t low = static_cast<std::int64_t>(a & 0xFFFFFFFF) * b;      // |.| < 2^63
  if (drop <= 32) return static_cast<std::int64_t>(static_cast<std::uint64_t>(high) << (32 - drop)) + (low >> drop);
  return (high + (low >> 32)) >> (drop - 32);
}

}  // namespace fixed_detail

template <int I, int F>
class Q {
  static_assert(I >= 0 && F >= 0, "a range below 1 or a step above 1 is not offered");
  static_assert(I + F <= 63, "more than 63 bits: store an operand in a narrower named type first");

 public:
  static constexpr int integer_bits = I;
  static constexpr int fraction_bits = F;
  using Raw = std::conditional_t<(I + F <= 31), std::int32_t, std::int64_t>;
  /// Largest raw value; the smallest is its negative, so that -x never overflows.
  static constexpr Raw raw_limit = static_cast<Raw>((std::uint64_t{1} << (I + F)) - 1);

  constexpr Q() = default;

  /// Whole numbers, e.g. Q<2, 29>(1). Saturates.
  constexpr explicit Q(int whole) : raw_{static_cast<Raw>(fixed_detail::saturated_shift(whole, F, raw_limit))} {}

  /// Constants and host-side conversions; saturates, NaN becomes 0. Not for the step on a core without FPU.
  constexpr explicit Q(double value) {
    const double scaled = value * static_cast<double>(std::uint64_t{1} << F);
    const double limit = static_cast<double>(raw_limit);
    if (scaled != scaled) raw_ = 0;
    else if (scaled >= limit) raw_ = raw_limit;
    else if (scaled <= -limit) raw_ = -raw_limit;
    else raw_ = static_cast<Raw>(scaled + (scaled < 0 ? -0.5 : 0.5));
  }

  /// From another range: rounds to nearest, saturates.
  template <int I2, int F2>
  constexpr Q(Q<I2, F2> other)  // NOLINT(google-explicit-constructor): narrowing at a named type is the idea
      : raw_{static_cast<Raw>(fixed_detail::saturated_shift(other.raw(), F - F2, raw_limit))} {}

  static constexpr Q from_raw(Raw raw) {
    Q q;
    q.raw_ = raw;
    return q;
  }
  static constexpr Q highest() { return from_raw(raw_limit); }

  constexpr Raw raw() const { return raw_; }
  constexpr explicit operator double() const {
    return static_cast<double>(raw_) / static_cast<double>(std::uint64_t{1} << F);
  }
  constexpr Q operator-() const { return from_raw(static_cast<Raw>(-raw_)); }

  constexpr Q& operator+=(Q o) { return *this = Q(*this + o); }
  constexpr Q& operator-=(Q o) { return *this = Q(*this - o); }

 private:
  Raw raw_ = 0;
};

namespace fixed_detail {

constexpr int larger(int a, int b) { return a > b ? a : b; }
constexpr int smaller(int a, int b) { return a < b ? a : b; }

/// Type that holds every sum or difference of the two. Where bits are short, one is left unused for the operands' own rounding.
template <int I1, int F1, int I2, int F2>
struct Sum {
  static constexpr int i = larger(I1, I2) + 1;
  static constexpr int f = smaller(larger(F1, F2), 62 - i);
  using type = Q<i, f>;
};

/// Raw value brought to f fraction bits; f is never more than the type that holds it has room for.
template <int I, int F>
constexpr std::int64_t aligned(Q<I, F> q, int f) {
  return shifted(q.raw(), f - F);
}

}  // namespace fixed_detail

template <int I1, int F1, int I2, int F2>
constexpr auto operator+(Q<I1, F1> a, Q<I2, F2> b) {
  using R = typename fixed_detail::Sum<I1, F1, I2, F2>::type;
  return R::from_raw(static_cast<typename R::Raw>(fixed_detail::aligned(a, R::fraction_bits) + fixed_detail::aligned(b, R::fraction_bits)));
}

template <int I1, int F1, int I2, int F2>
constexpr auto operator-(Q<I1, F1> a, Q<I2, F2> b) {
  return a + (-b);
}

template <int I1, int F1, int I2, int F2>
constexpr auto operator*(Q<I1, F1> a, Q<I2, F2> b) {
  constexpr int i = I1 + I2;
  constexpr bool wide_a = I1 + F1 > 31, wide_b = I2 + F2 > 31;
  static_assert(!(wide_a && wide_b), "64 x 64 bit: store one operand in a narrower named type first");
  if constexpr (!wide_a && !wide_b) {
    using R = Q<i, F1 + F2>;
    return R::from_raw(static_cast<typename R::Raw>(static_cast<std::int64_t>(a.raw()) * b.raw()));
  } else if constexpr (wide_b) {
    return b * a;
  } else {
    constexpr int f = fixed_detail::smaller(F1 + F2, 63 - i);
    return Q<i, f>::from_raw(fixed_detail::wide_product(a.raw(), static_cast<std::int32_t>(b.raw()), F1 + F2 - f));
  }
}

template <int I1, int F1, int I2, int F2>
constexpr std::strong_ordering operator<=>(Q<I1, F1> a, Q<I2, F2> b) {
  constexpr int f = fixed_detail::smaller(fixed_detail::larger(F1, F2), 63 - fixed_detail::larger(I1, I2));
  return fixed_detail::aligned(a, f) <=> fixed_detail::aligned(b, f);
}
template <int I1, int F1, int I2, int F2>
constexpr bool operator==(Q<I1, F1> a, Q<I2, F2> b) {
  return (a <=> b) == 0;
}

/// numerator / denominator stored in R, relative error below 2^-30 plus half a step of R; saturates; x / 0 is R's end.
template <class R, int I1, int F1, int I2, int F2>
constexpr R ratio(Q<I1, F1> numerator, Q<I2, F2> denominator) {
  const bool negative = (numerator.raw() < 0) != (denominator.raw() < 0);
  std::uint64_t n = numerator.raw() < 0 ? -static_cast<std::uint64_t>(numerator.raw()) : static_cast<std::uint64_t>(numerator.raw());
  std::uint64_t d = denominator.raw() < 0 ? -static_cast<std::uint64_t>(denominator.raw()) : static_cast<std::uint64_t>(denominator.raw());
  if (n == 0) return R{};
  if (d == 0) return negative ? -R::highest() : R::highest();
  // n gets 63 significant bits, d 32: the 64 / 32 bit quotient then has 31 or 32
  const int up_n = std::countl_zero(n) - 1;
  n <<= up_n;
  const int up_d = std::countl_zero(d) - 32;
  d = up_d >= 0 ? d << up_d : (d >> -up_d);
  const auto quotient = static_cast<std::int64_t>(n / d);  // value * 2^(up_n - up_d + F1 - F2)
  const int shift = R::fraction_bits - (up_n - up_d + F1 - F2);
  const std::int64_t raw = fixed_detail::saturated_shift(quotient, shift > 62 ? 62 : shift, R::raw_limit);
  return R::from_raw(static_cast<typename R::Raw>(negative ? -raw : raw));
}

/// Square root stored in R, rounded down to a step of R; 0 for negative arguments.
template <class R, int I, int F>
constexpr R root(Q<I, F> x) {
  if (x.raw() <= 0) return R{};
  // normalise to an even number of fraction bits with as many significant bits as fit
  auto v = static_cast<std::uint64_t>(x.raw());
  int up = std::countl_zero(v) - 1;
  if ((F + up) % 2 != 0) --up;
  v <<= up;
  std::uint64_t result = 0;
  for (std::uint64_t bit = std::uint64_t{1} << 62; bit != 0; bit >>= 2) {
    if (v >= result + bit) {
      v -= result + bit;
      result = (result >> 1) + bit;
    } else {
      result >>= 1;
    }
  }
  // result has (F + up) / 2 fraction bits
  return R::from_raw(static_cast<typename R::Raw>(
      fixed_detail::saturated_shift(static_cast<std::int64_t>(result), R::fraction_bits - (F + up) / 2, R::raw_limit)));
}

}  // namespace bms::model
