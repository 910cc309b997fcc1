// The number types of the physics: one type per quantity, chosen by the scalar.
//
//   float, double, ceres::Jet   every quantity is that type; the names below only document
//   FixedPoint                  every quantity has its own range and step (arithmetic/fixed.hpp)
//
// An expression of quantities is plain algebra. A fixed-point value is rounded when it is stored in a named quantity:
//
//   const Voltage<S> drop_v = r0_ohm * current_a;
//
// The ranges below cover every cell file that model/cell_parameters.hpp accepts.
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>

#include "arithmetic/fixed.hpp"

namespace bms::arithmetic {

/// Selects the integer arithmetic of cores without an FPU.
struct FixedPoint {};

template <class S>
struct Quantities {  // a floating-point or dual number: one type for all
  using Soc = S;
  using PerSoc = S;
  using Voltage = S;
  using VoltagePerSoc = S;
  using Current = S;
  using Resistance = S;
  using Capacitance = S;
  using Duration = S;
  using TimeStep = S;
  using Exponent = S;
  using Rate = S;
  using Fraction = S;
  using Variance = S;
  using Coupling = S;
  using Count = S;
  using Temperature = S;
  using Factor = S;
};

template <>
struct Quantities<FixedPoint> {  // 30 bits for quantities that are added: the sum of two then has 31
  using Soc = Q<3, 27>;          // +-8, step 7.5e-9
  using PerSoc = PowerOfTwo;     // up to 2,048: no interval is narrower
  using Voltage = Q<3, 27>;      // +-8 V, step 7.5 nV; also every other state but soc
  using VoltagePerSoc = Scaled;
  using Current = Q<11, 19>;      // +-2,048 A, step 2 uA
  using Resistance = Q<0, 30>;    // below 1 ohm, step 1 nohm
  using Capacitance = Q<17, 13>;  // below 131 kF
  using Duration = Q<17, 13>;     // time constants, below 131,072 s
  using TimeStep = Q<12, 19>;     // below 4,096 s, step 1.9 us; a longer one counts as 4,096 s: everything has settled
  using Rate = Q<3, 28>;          // 1 / time constant: 0.125 s and longer
  using Exponent = Q<15, 47>;     // time step times rate
  using Fraction = Q<1, 29>;      // +-2
  using Variance = Scaled;        // 30 bits, of any size
  using Coupling = Scaled;        // one state per unit of another
  using Count = Scaled;           // number of samples that share one error
  using Temperature = Q<9, 21>;   // +-512 degrees C or K, step 0.5 uK
  using Factor = Q<7, 23>;        // multiplies a resistance; below 128
};

template <class S>
using Soc = typename Quantities<S>::Soc;  ///< 0 empty .. 1 full
template <class S>
using PerSoc = typename Quantities<S>::PerSoc;  ///< 1 per unit of soc
template <class S>
using Voltage = typename Quantities<S>::Voltage;  ///< V
template <class S>
using VoltagePerSoc = typename Quantities<S>::VoltagePerSoc;  ///< V per unit of soc
template <class S>
using Current = typename Quantities<S>::Current;  ///< A, > 0 charges
template <class S>
using Resistance = typename Quantities<S>::Resistance;  ///< ohm
template <class S>
using Capacitance = typename Quantities<S>::Capacitance;  ///< F
template <class S>
using Duration = typename Quantities<S>::Duration;  ///< s
template <class S>
using TimeStep = typename Quantities<S>::TimeStep;  ///< s
template <class S>
using Exponent = typename Quantities<S>::Exponent;  ///< 1
template <class S>
using Rate = typename Quantities<S>::Rate;  ///< 1/s
template <class S>
using Fraction = typename Quantities<S>::Fraction;  ///< 1
template <class S>
using Variance = typename Quantities<S>::Variance;  ///< square of a state's unit
template <class S>
using Coupling = typename Quantities<S>::Coupling;  ///< state per state
template <class S>
using Count = typename Quantities<S>::Count;  ///< 1
template <class S>
using Temperature = typename Quantities<S>::Temperature;  ///< degrees C
template <class S>
using Factor = typename Quantities<S>::Factor;  ///< 1

/// a * b stored in R. Needed only if both operands are wide (variances); elsewhere write a * b.
template <class R, class A, class B>
constexpr R product(const A& a, const B& b) {
  return R(a * b);
}

template <class R, class S>
requires(!InIntegers<R>) constexpr R ratio(const S& numerator, const S& denominator) { return numerator / denominator; }

template <class R, class S>
requires(!InIntegers<R>) R root(const S& x) {
  using std::sqrt;  // IEEE 754: correctly rounded, equal on every core; a Jet brings its own
  return sqrt(x);
}

/// The quantity that belongs to a measurement in integer micro-units, e.g. microamperes to amperes.
template <class R>
constexpr R from_micro(std::int32_t micro) {
  if constexpr (is_q<R>) {
    constexpr std::int32_t factor = 1'125'899'907;  // 2^50 / 10^6
    return R::from_raw(rounded_product<50 - R::fraction_bits, R::integer_bits + R::fraction_bits>(micro, factor));
  } else if constexpr (std::same_as<R, float>) {
    return static_cast<float>(micro) * 1e-6F;
  } else {
    return R(static_cast<double>(micro) * 1e-6);
  }
}

/// Microseconds as a time step.
template <class S>
constexpr TimeStep<S> seconds(std::uint32_t us) {
  if constexpr (is_q<TimeStep<S>>)
    return ratio<TimeStep<S>>(Q<32, 0>::from_raw(us), Q<20, 0>(1'000'000));
  else if constexpr (std::same_as<S, float>)
    return static_cast<float>(us) * 1e-6F;
  else
    return S(static_cast<double>(us) * 1e-6);
}

/// Absolute value.
template <class T>
constexpr T magnitude(const T& x) {
  if constexpr (std::same_as<T, float>)
    return __builtin_fabsf(x);
  else
    return x < T(0) ? T(-x) : x;
}

/// Hundredths, e.g. of a degree.
template <class R>
constexpr R from_centi(std::int16_t centi) {
  if constexpr (is_q<R>)
    return ratio<R>(Q<16, 0>::from_raw(centi), Q<7, 0>(100));
  else if constexpr (std::same_as<R, float>)
    return static_cast<float>(centi) * 0.01F;
  else
    return R(static_cast<double>(centi) * 0.01);
}

/// The nearest integer in micro-units, clamped to +-2,147 of the quantity's units. Not-a-number becomes 0.
template <class T>
constexpr std::int32_t to_micro(const T& x) {
  if constexpr (is_q<T>) {
    static_assert(T::integer_bits + T::fraction_bits <= 31);
    constexpr std::int64_t most = 2'147'483'647, half = std::int64_t{1} << (T::fraction_bits - 1);
    const std::int64_t micro = (static_cast<std::int64_t>(x.raw()) * 1'000'000 + half) >> T::fraction_bits;
    return static_cast<std::int32_t>(arithmetic::clamped(micro, most));
  } else if constexpr (std::floating_point<T>) {
    const T clamped = arithmetic::clamped(x == x ? x : T(0), T(2'147));
    return static_cast<std::int32_t>(clamped * T(1'000'000) + (clamped < T(0) ? T(-0.5) : T(0.5)));
  } else {
    return to_micro(x.a);  // a dual number
  }
}

/// The value as double, for reports and tests; never in the step.
template <class T>
requires(InIntegers<T> || std::floating_point<T>) constexpr double as_double(const T& x) {
  return static_cast<double>(x);
}

}  // namespace bms::arithmetic
