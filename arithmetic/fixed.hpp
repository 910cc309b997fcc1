// Fixed-point numbers whose range is part of their type.
//
//   Q<I, F>  holds  -2^I < value < 2^I  in steps of 2^-F,  as int32_t when I + F <= 31, else as int64_t
//
// A sum or a product gets a type that holds every possible result. Arithmetic therefore cannot overflow: it would not
// compile. If 63 bits are not enough, fraction bits are dropped, never integer bits. A value is narrowed only when it
// is stored in a named type (`const Voltage v = r0 * current;`): this conversion rounds to nearest and saturates at the
// end of the range. There is no implicit conversion from or to floating point.
//
// The same integer instructions run on every core, so the bits are equal on host and target. No 128-bit type is needed.
// Source of the notation: Texas Instruments' Qm.n, sign bit not counted.
#pragma once

#include <bit>
#include <compare>
#include <concepts>
#include <cstdint>
#include <type_traits>

#include "arithmetic/scaled.hpp"
#include "arithmetic/wide_product.hpp"

namespace bms::arithmetic {

template <int I, int F>
class Q;

template <class A, class B>
class Product;

/// 2^exponent, 0 <= exponent < 31: a factor that is a shift.
struct PowerOfTwo {
  std::int32_t exponent = 0;

  constexpr PowerOfTwo() = default;
  /// The largest power of two that is not above the value; for constants and conversions on the host.
  constexpr explicit PowerOfTwo(double value) {
    while (exponent < 30 && value >= 2) {
      value /= 2;
      ++exponent;
    }
  }
  constexpr explicit operator double() const { return static_cast<double>(std::int32_t{1} << exponent); }
};

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
  // v + half may leave the range by one bit only when v is within half of the end; shift first, then add the carried
  // bit
  return (v >> -shift) + ((v & (half * 2 - 1)) >= half ? 1 : 0);
}

/// v * 2^shift, clamped to +-limit.
constexpr std::int64_t saturated_shift(std::int64_t v, int shift, std::int64_t limit) {
  if (shift > 0) {
    const std::int64_t room = limit >> shift;
    if (v > room) return limit;
    if (v < -room) return -limit;
  }
  const std::int64_t r = shifted(v, shift);
  return clamped(r, limit);
}

/// v * 2^up, 0 <= up < 31, clamped to +-limit.
constexpr std::int32_t shifted_up(std::int32_t v, std::int32_t up, std::int32_t limit) {
  const std::int32_t room = limit >> up;
  if (v > room) return limit;
  if (v < -room) return -limit;
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(v) << up);
}

/// v, which has at most From bits, times 2^Shift, rounded to nearest, as a number of To bits, clamped to +-(2^To - 1).
template <int From, int Shift, int To, class Raw>
constexpr auto converted(Raw v) {
  using Out = std::conditional_t<(To <= 31), std::int32_t, std::int64_t>;
  constexpr auto limit = static_cast<Out>((std::uint64_t{1} << To) - 1);
  if constexpr (Shift >= 0) {
    if constexpr (From + Shift <= To) {
      return static_cast<Out>(static_cast<std::conditional_t<(To <= 31), std::uint32_t, std::uint64_t>>(v) << Shift);
    } else {
      constexpr auto room = static_cast<Raw>(Shift < 63 ? static_cast<std::uint64_t>(limit) >> Shift : 0);
      if (v > room) return limit;
      if (v < -room) return static_cast<Out>(-limit);
      return static_cast<Out>(static_cast<std::uint64_t>(v) << Shift);
    }
  } else if constexpr (-Shift > From) {
    return Out{0};
  } else {
    const Raw r = static_cast<Raw>((v >> -Shift) + (v >> (-Shift - 1) & 1));
    if constexpr (From + Shift < To) {
      return static_cast<Out>(r);
    } else if constexpr (To == 31 && sizeof(Raw) > sizeof(Out)) {
      const auto low = static_cast<std::int32_t>(r);
      if (low == r && low != -limit - 1) [[likely]]
        return low;
      return r < 0 ? -limit : limit;
    } else {
      return static_cast<Out>(clamped<Raw>(r, limit));
    }
  }
}

/// a * b * 2^-drop, rounded towards minus infinity, for 64 x 32 bit; the caller's types guarantee that the result fits.
constexpr std::int64_t wider_product(std::int64_t a, std::int32_t b, int drop) {
  const std::int64_t high = (a >> 32) * b;                                 // |.| < 2^62
  const std::int64_t low = static_cast<std::int64_t>(a & 0xFFFFFFFF) * b;  // |.| < 2^63
  if (drop <= 32) return static_cast<std::int64_t>(static_cast<std::uint64_t>(high) << (32 - drop)) + (low >> drop);
  return (high + (low >> 32)) >> (drop - 32);
}

template <class A, class B>
inline constexpr int most_bits =
    A::integer_bits + A::fraction_bits > B::integer_bits + B::fraction_bits ? A::integer_bits + A::fraction_bits
                                                                            : B::integer_bits + B::fraction_bits;

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

  /// For constants and conversions on the host; saturates, NaN becomes 0. Not for the step on a core without FPU.
  constexpr explicit Q(double value) {
    const double scaled = value * static_cast<double>(std::uint64_t{1} << F);
    const double limit = static_cast<double>(raw_limit);
    if (scaled != scaled)
      raw_ = 0;
    else if (scaled >= limit)
      raw_ = raw_limit;
    else if (scaled <= -limit)
      raw_ = -raw_limit;
    else
      raw_ = static_cast<Raw>(scaled + (scaled < 0 ? -0.5 : 0.5));
  }

  /// From another range: rounds to nearest, saturates.
  template <int I2, int F2>
  constexpr Q(Q<I2, F2> other)  // NOLINT(google-explicit-constructor): narrowing at a named type is intended
      : raw_{fixed_detail::converted<I2 + F2, F - F2, I + F>(other.raw())} {}

  /// The same from a number with its own exponent.
  constexpr Q(Scaled other) : raw_{other.in_steps(F, raw_limit)} {}  // NOLINT(google-explicit-constructor)

  /// From a product: the same, without computing its exact value first if that would take longer.
  template <class A, class B>
  constexpr Q(const Product<A, B>& product) : raw_{stored(product)} {}  // NOLINT(google-explicit-constructor)
  template <class A>
  constexpr Q(const Product<A, PowerOfTwo>& product)  // NOLINT(google-explicit-constructor)
      : raw_{fixed_detail::shifted_up(Q(product.a).raw(), product.b.exponent, raw_limit)} {}

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
  template <class A, class B>
  static constexpr Raw stored(const Product<A, B>& product) {
    constexpr int shift = A::fraction_bits + B::fraction_bits - F;
    if constexpr (sizeof(typename A::Raw) + sizeof(typename B::Raw) == 2 * sizeof(std::int32_t) && I + F <= 31 &&
                  shift >= 0 && Product<A, B>::Exact::integer_bits + Product<A, B>::Exact::fraction_bits > 31)
      return rounded_product<shift, I + F, fixed_detail::most_bits<A, B>>(product.a.raw(), product.b.raw());
    else
      return Q(product.exact()).raw();
  }

  Raw raw_ = 0;
};

namespace fixed_detail {

constexpr int larger(int a, int b) { return a > b ? a : b; }
constexpr int smaller(int a, int b) { return a < b ? a : b; }

/// Type that holds every sum or difference of the two. If bits are scarce, one stays unused for the rounding of the
/// operands.
template <int I1, int F1, int I2, int F2>
struct Sum {
  static constexpr int i = larger(I1, I2) + 1;
  static constexpr int f = smaller(larger(F1, F2), 62 - i);
  using type = Q<i, f>;
};

/// Raw value brought to f fraction bits; f is never more than the type that holds it has room for.
template <class Raw, int To, int I, int F>
constexpr Raw aligned(Q<I, F> q) {
  return static_cast<Raw>(converted<I + F, To - F, I + To>(q.raw()));
}

}  // namespace fixed_detail

template <int I1, int F1, int I2, int F2>
constexpr auto operator+(Q<I1, F1> a, Q<I2, F2> b) {
  using R = typename fixed_detail::Sum<I1, F1, I2, F2>::type;
  using Raw = typename R::Raw;
  return R::from_raw(fixed_detail::aligned<Raw, R::fraction_bits>(a) + fixed_detail::aligned<Raw, R::fraction_bits>(b));
}

template <int I1, int F1, int I2, int F2>
constexpr auto operator-(Q<I1, F1> a, Q<I2, F2> b) {
  return a + (-b);
}

namespace fixed_detail {

template <int I1, int F1, int I2, int F2>
constexpr auto exact_product(Q<I1, F1> a, Q<I2, F2> b) {
  constexpr int i = I1 + I2;
  constexpr bool wide_a = I1 + F1 > 31, wide_b = I2 + F2 > 31;
  static_assert(!(wide_a && wide_b), "64 x 64 bit: store one operand in a narrower named type first");
  if constexpr (!wide_a && !wide_b) {
    using R = Q<i, F1 + F2>;
    if constexpr (i + F1 + F2 <= 31) return R::from_raw(a.raw() * b.raw());
    return R::from_raw(static_cast<typename R::Raw>(wide_product(a.raw(), b.raw())));
  } else if constexpr (wide_b) {
    return exact_product(b, a);
  } else {
    constexpr int f = fixed_detail::smaller(F1 + F2, 63 - i);
    return Q<i, f>::from_raw(fixed_detail::wider_product(a.raw(), static_cast<std::int32_t>(b.raw()), F1 + F2 - f));
  }
}

template <class T>
constexpr auto exact(const T& x) {
  if constexpr (is_q<T>)
    return x;
  else
    return x.exact();
}

}  // namespace fixed_detail

/// Two factors. They are multiplied when the destination is known: directly into a named type, else exactly.
template <class A, class B>
class Product {
 public:
  using Exact = decltype(fixed_detail::exact_product(A{}, B{}));

  constexpr Product(const A& first, const B& second) : a(first), b(second) {}
  constexpr Exact exact() const { return fixed_detail::exact_product(a, b); }
  constexpr Product operator-() const { return {-a, b}; }
  constexpr explicit operator double() const { return static_cast<double>(exact()); }

  A a;
  B b;
};

/// Product by a power of two: a shift when stored in a named type, a change of the exponent in a scaled number.
template <class A>
class Product<A, PowerOfTwo> {
 public:
  constexpr Product(const A& first, const PowerOfTwo& second) : a(first), b(second) {}
  constexpr Product operator-() const { return {-a, b}; }

  A a;
  PowerOfTwo b;
};

template <class T>
inline constexpr bool is_product = false;
template <class A, class B>
inline constexpr bool is_product<Product<A, B>> = true;

template <int I1, int F1, int I2, int F2>
constexpr Product<Q<I1, F1>, Q<I2, F2>> operator*(Q<I1, F1> a, Q<I2, F2> b) {
  return {a, b};
}

template <int I, int F>
constexpr Product<Q<I, F>, PowerOfTwo> operator*(Q<I, F> a, PowerOfTwo b) {
  return {a, b};
}

template <class A, class B>
concept OneIsAProduct = (is_product<A> && (is_product<B> || is_q<B>)) || (is_q<A> && is_product<B>);

template <class A, class B>
requires OneIsAProduct<A, B>
constexpr auto operator+(const A& a, const B& b) { return fixed_detail::exact(a) + fixed_detail::exact(b); }
template <class A, class B>
requires OneIsAProduct<A, B>
constexpr auto operator-(const A& a, const B& b) { return fixed_detail::exact(a) - fixed_detail::exact(b); }
template <class A, class B>
requires OneIsAProduct<A, B>
constexpr auto operator*(const A& a, const B& b) { return fixed_detail::exact(a) * fixed_detail::exact(b); }
template <class A, class B>
requires OneIsAProduct<A, B>
constexpr bool operator<(const A& a, const B& b) { return fixed_detail::exact(a) < fixed_detail::exact(b); }

template <int I1, int F1, int I2, int F2>
constexpr std::strong_ordering operator<=>(Q<I1, F1> a, Q<I2, F2> b) {
  constexpr int i = fixed_detail::larger(I1, I2), f = fixed_detail::smaller(fixed_detail::larger(F1, F2), 63 - i);
  using Raw = std::conditional_t<(i + f <= 31), std::int32_t, std::int64_t>;
  return fixed_detail::aligned<Raw, f>(a) <=> fixed_detail::aligned<Raw, f>(b);
}
template <int I1, int F1, int I2, int F2>
constexpr bool operator==(Q<I1, F1> a, Q<I2, F2> b) {
  return (a <=> b) == 0;
}

/// Fixed point, or a number with its own exponent.
template <class T>
concept InIntegers = is_q<T> || is_product<T> || std::same_as<T, Scaled> || std::same_as<T, PowerOfTwo>;

/// numerator / denominator stored in R, relative error below 2^-26 + 2^-27 + 2^-29 (product and reciprocal,
/// arithmetic/scaled.hpp) plus 2^-29 for each operand of more than 30 bits, and half a step of R; saturates; x / 0 is
/// the end of R's range, 0 / 0 is 0.
template <InIntegers R, InIntegers A, InIntegers B>
constexpr R ratio(const A& numerator, const B& denominator) {
  return R(Scaled(numerator) * Scaled(denominator).reciprocal());
}

/// Square root stored in R, relative error below 2^-26, the same for operands and step; 0 for negative arguments.
template <InIntegers R, InIntegers A>
constexpr R root(const A& x) {
  return R(Scaled(x).root());
}

}  // namespace bms::arithmetic
