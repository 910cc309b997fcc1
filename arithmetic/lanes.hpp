// A number for each of several cells, as one scalar: the physics is then computed for all of them at once.
//
//   Lanes<2>   two vector registers of float: 8 lanes with SSE2, 16 with AVX2
//
// Every operation gives each lane the bits that float gives (compile with -ffp-contract=off). A comparison gives a
// mask; select() takes the place of ?:. More than one register hides the latency of divisions. Host only.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <experimental/simd>
#include <type_traits>

#include "arithmetic/exponential.hpp"
#include "arithmetic/scalar.hpp"

namespace bms::arithmetic {

using FloatRegister = std::experimental::native_simd<float>;
using IntRegister = std::experimental::rebind_simd_t<std::int32_t, FloatRegister>;

/// One truth value for each lane.
template <class Register, std::size_t Registers>
struct MaskOf {
  std::array<typename Register::mask_type, Registers> part;

  friend MaskOf operator&(const MaskOf& a, const MaskOf& b) {
    MaskOf both;
    for (std::size_t k = 0; k < Registers; ++k) both.part[k] = a.part[k] && b.part[k];
    return both;
  }
  friend MaskOf operator|(const MaskOf& a, const MaskOf& b) {
    MaskOf either;
    for (std::size_t k = 0; k < Registers; ++k) either.part[k] = a.part[k] || b.part[k];
    return either;
  }
  friend MaskOf operator!(const MaskOf& a) {
    MaskOf other;
    for (std::size_t k = 0; k < Registers; ++k) other.part[k] = !a.part[k];
    return other;
  }
  bool operator[](std::size_t lane) const { return part[lane / Register::size()][lane % Register::size()]; }
};

template <class Register, std::size_t Registers>
bool all(const MaskOf<Register, Registers>& mask) {
  bool all = true;
  for (const auto& part : mask.part) all = all && std::experimental::all_of(part);
  return all;
}
template <class Register, std::size_t Registers>
bool any(const MaskOf<Register, Registers>& mask) {
  return !all(!mask);
}

/// Values in vector registers. Number: float, or std::int32_t for readings and counts.
template <class Register, std::size_t Registers>
class LanesOf {
 public:
  using Part = Register;
  using Number = typename Register::value_type;
  using Mask = MaskOf<Register, Registers>;
  static constexpr std::size_t size = Registers * Register::size();
  using Array = std::array<Number, size>;

  LanesOf() : LanesOf(Number{0}) {}
  /// The same value in each lane. Implicit for the lanes' own type, as for a scalar.
  template <class T>
  requires std::is_arithmetic_v<T>
  explicit(!std::same_as<T, Number>) LanesOf(T all) { part_.fill(Register(static_cast<Number>(all))); }
  explicit LanesOf(const Array& from) {
    for (std::size_t k = 0; k < Registers; ++k)
      part_[k].copy_from(from.data() + k * Register::size(), std::experimental::element_aligned);
  }

  /// of(lane) in each lane. Values that have just been computed: numbers that are stored one by one and loaded together
  /// cost more.
  template <class F>
  static LanesOf each(F&& of) {
    LanesOf result{Uninitialised{}};
    for (std::size_t k = 0; k < Registers; ++k)
      result.part_[k] = Register([&](auto lane) { return static_cast<Number>(of(k * Register::size() + lane)); });
    return result;
  }

  Array array() const {
    Array to;
    for (std::size_t k = 0; k < Registers; ++k)
      part_[k].copy_to(to.data() + k * Register::size(), std::experimental::element_aligned);
    return to;
  }
  Number operator[](std::size_t lane) const { return part_[lane / Register::size()][lane % Register::size()]; }
  void set(std::size_t lane, Number value) { part_[lane / Register::size()][lane % Register::size()] = value; }

  friend LanesOf operator+(const LanesOf& a, const LanesOf& b) {
    return map([](const Register& x, const Register& y) { return x + y; }, a, b);
  }
  friend LanesOf operator-(const LanesOf& a, const LanesOf& b) {
    return map([](const Register& x, const Register& y) { return x - y; }, a, b);
  }
  friend LanesOf operator*(const LanesOf& a, const LanesOf& b) {
    return map([](const Register& x, const Register& y) { return x * y; }, a, b);
  }
  friend LanesOf operator/(const LanesOf& a, const LanesOf& b) {
    return map([](const Register& x, const Register& y) { return x / y; }, a, b);
  }
  LanesOf operator-() const {
    return map([](const Register& x) { return -x; }, *this);
  }
  LanesOf& operator+=(const LanesOf& b) { return *this = *this + b; }

  friend Mask operator<(const LanesOf& a, const LanesOf& b) {
    return compare([](const Register& x, const Register& y) { return x < y; }, a, b);
  }
  friend Mask operator<=(const LanesOf& a, const LanesOf& b) {
    return compare([](const Register& x, const Register& y) { return x <= y; }, a, b);
  }
  friend Mask operator>(const LanesOf& a, const LanesOf& b) { return b < a; }
  friend Mask operator>=(const LanesOf& a, const LanesOf& b) { return b <= a; }
  friend Mask operator==(const LanesOf& a, const LanesOf& b) {
    return compare([](const Register& x, const Register& y) { return x == y; }, a, b);
  }

  /// Lane by lane: mask ? a : b.
  friend LanesOf select(const Mask& mask, const LanesOf& a, const LanesOf& b) {
    LanesOf result = b;
    for (std::size_t k = 0; k < Registers; ++k) std::experimental::where(mask.part[k], result.part_[k]) = a.part_[k];
    return result;
  }
  friend LanesOf sqrt(const LanesOf& x) requires std::floating_point<Number> {
    return map([](const Register& r) { return std::experimental::sqrt(r); }, x);
  }
  friend LanesOf magnitude(const LanesOf& x) requires std::floating_point<Number> {
    return map([](const Register& r) { return std::experimental::fabs(r); }, x);
  }
  /// static_cast of each lane.
  template <class Other>
  Other as() const {
    Other result;
    for (std::size_t k = 0; k < Registers; ++k)
      result.part_[k] = std::experimental::static_simd_cast<typename Other::Part>(part_[k]);
    return result;
  }

 private:
  template <class OtherRegister, std::size_t OtherRegisters>
  friend class LanesOf;

  template <class F, class... L>
  static LanesOf map(F&& f, const L&... of) {
    LanesOf result{Uninitialised{}};
    for (std::size_t k = 0; k < Registers; ++k) result.part_[k] = f(of.part_[k]...);
    return result;
  }
  template <class F>
  static Mask compare(F&& f, const LanesOf& a, const LanesOf& b) {
    Mask mask;
    for (std::size_t k = 0; k < Registers; ++k) mask.part[k] = f(a.part_[k], b.part_[k]);
    return mask;
  }
  struct Uninitialised {};
  explicit LanesOf(Uninitialised) {}

  std::array<Register, Registers> part_;
};

template <std::size_t Registers>
using Lanes = LanesOf<FloatRegister, Registers>;
template <std::size_t Registers>
using IntLanes = LanesOf<IntRegister, Registers>;

template <std::size_t Registers>
inline constexpr bool exponential_detail::short_mantissa<Lanes<Registers>> = true;
template <std::size_t Registers>
struct exponential_detail::ConstantOf<Lanes<Registers>> {
  using type = float;
};

/// Microamperes to amperes, and so on, as from_micro<float>() of each lane.
template <std::size_t Registers>
Lanes<Registers> from_micro(const IntLanes<Registers>& micro) {
  return micro.template as<Lanes<Registers>>() * Lanes<Registers>(1e-6F);
}

/// Returns true if a lane is beyond the range of the polynomial.
template <class S>
requires ManyNumbers<S>
constexpr bool long_step(const Fraction<S>& x) { return any(x > S(0.25F)); }

/// 1 - exp(-x) of each lane. Lanes are halved together, as often as the longest step needs; each takes the value that
/// it had when it was short enough.
template <class S>
requires ManyNumbers<S>
constexpr Fraction<S> step_response(const Exponent<S>& x) {
  constexpr std::size_t most_halvings = 7;  // 32 / 2^7 = 1/4
  const S one(1.0F), quarter(0.25F), half(0.5F);
  const auto infinite = x > S(32.0F);
  S halved = select(infinite, one, x);
  std::array<S, most_halvings + 1> of;
  std::size_t halvings = 0;
  for (of[0] = halved; halvings < most_halvings && any(halved > quarter); of[++halvings] = halved)
    halved = halved * half;
  S result = step_response_short<S>(halved);
  for (; halvings > 0; --halvings)
    result = select(of[halvings - 1] > quarter, result * (S(2.0F) - result), step_response_short<S>(of[halvings - 1]));
  return select(infinite, one, result);
}

}  // namespace bms::arithmetic
