// 1 - exp(-x) for x >= 0: the settled part of a step response after x time constants.
//
// A polynomial instead of libm, whose last bit differs between libraries and cores. 1 - exp(-x) instead of exp(-x),
// because steps are short compared with the time constant and the difference to 1 would have lost its digits.
//
//   x <= 1/4:  x (c0 + x (c1 + ...))         relative error 3.4e-7 for float, 1e-15 for double; fixed point: of its
//                                            steps
//   x >  1/4:  halved until it is not, then  settled(2x) = settled(x) (2 - settled(x))  once per halving
//   x >  32:   1
//
// Negative x and NaN give a meaningless value, but the computation ends.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>

#include "arithmetic/scalar.hpp"

namespace bms::arithmetic {

namespace exponential_detail {

template <class S>
inline constexpr bool short_mantissa = std::same_as<S, float> || std::same_as<S, FixedPoint>;

/// Type of a constant that is added to F or multiplies it.
template <class F>
struct ConstantOf {
  using type = F;
};

/// (1 - exp(-x)) / x on [0, 1/4], degree 3: interpolation in the Chebyshev nodes, error below 2.4e-7.
inline constexpr std::array<double, 4> chebyshev = {0.9999997659, -0.4999699927, 0.1660622501, -0.03772897426};

/// Taylor series of the same function, 1 / (n + 1)! with alternating sign; the first omitted term is below 1e-17.
inline constexpr std::array<double, 12> taylor = {
    1.0,         -1.0 / 2,      1.0 / 6,       -1.0 / 24,        1.0 / 120,        -1.0 / 720,
    1.0 / 5'040, -1.0 / 40'320, 1.0 / 362'880, -1.0 / 3'628'800, 1.0 / 39'916'800, -1.0 / 479'001'600};

template <class F, std::size_t N>
inline constexpr auto converted(const std::array<double, N>& from) {
  std::array<F, N> to{};
  for (std::size_t k = 0; k < N; ++k) to[k] = F(from[k]);
  return to;
}

}  // namespace exponential_detail

/// A dual number: value `a`, derivatives `v` (ceres::Jet).
template <class S>
concept Dual = requires(S s) {
  s.a;
  s.v;
};

/// A number for each of several cells. Its overloads are in arithmetic/lanes.hpp.
template <class S>
concept ManyNumbers = requires {
  typename S::Mask;
};

namespace exponential_detail {

/// p = settled(x), with its derivative exp(-x).
template <Dual S>
constexpr S with_derivative(S x, const decltype(S::a)& p) {
  x.v *= 1 - p;
  x.a = p;
  return x;
}

}  // namespace exponential_detail

/// Returns true if x is beyond the range of the polynomial.
template <class S>
requires(!ManyNumbers<S>) constexpr bool long_step(const Fraction<S>& x) { return x > Fraction<S>(0.25); }

/// 1 - exp(-x) for x <= 1/4.
template <class S>
constexpr Fraction<S> step_response_short(Fraction<S> x) {
  using F = Fraction<S>;
  namespace d = exponential_detail;
  if constexpr (Dual<S>) return exponential_detail::with_derivative(x, step_response_short<decltype(x.a)>(x.a));
  F q;
  if constexpr (d::short_mantissa<S>) {
    constexpr auto c = d::converted<typename d::ConstantOf<F>::type>(d::chebyshev);
    const F x2(x * x);  // in pairs (Estrin): half as long a chain of dependent operations as Horner's
    q = F((c[0] + F(x * c[1])) + F(x2 * F(c[2] + F(x * c[3]))));
  } else if constexpr (std::same_as<F, double>) {
    constexpr auto& c = d::taylor;
    const F x2 = x * x, x4 = x2 * x2;
    const auto four = [&](std::size_t k) { return (c[k] + x * c[k + 1]) + x2 * (c[k + 2] + x * c[k + 3]); };
    q = four(0) + x4 * (four(4) + x4 * four(8));
  } else {
    q = F(d::taylor.back());
    for (std::size_t k = d::taylor.size() - 1; k-- > 0;) q = F(d::taylor[k]) + x * q;
  }
  return F(x * q);
}

/// 1 - exp(-x).
template <class S>
requires(!ManyNumbers<S>) constexpr Fraction<S> step_response(const Exponent<S>& x) {
  using F = Fraction<S>;
  if constexpr (Dual<S>) return exponential_detail::with_derivative(x, step_response<decltype(x.a)>(x.a));
  if constexpr (std::same_as<F, double>) {  // without recursion, to be inlined
    if (x > 32) return 1;
    double halved = x;
    int halvings = 0;
    for (; halved > 0.25; halved *= 0.5) ++halvings;
    double response = step_response_short<double>(halved);
    for (; halvings > 0; --halvings) response *= 2 - response;
    return response;
  }
  if (x > Exponent<S>(0.25)) [[unlikely]] {
    if (x > Exponent<S>(32)) return F(1);
    const F half = step_response<S>(product<Exponent<S>>(x, F(0.5)));
    return F(half * F(F(2) - half));
  }
  return step_response_short<S>(F(x));
}

/// 1 - exp(-duration * rate); rate = 1 / time constant. The product is computed in the wider type if it is long.
template <class S>
constexpr Fraction<S> step_response_after(const TimeStep<S>& duration_s, const Rate<S>& rate_per_s) {
  const Fraction<S> x = duration_s * rate_per_s;
  if (long_step<S>(x)) [[unlikely]]
    return step_response<S>(Exponent<S>(duration_s * rate_per_s));
  return step_response_short<S>(x);
}

}  // namespace bms::arithmetic
