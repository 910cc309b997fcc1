// A dual number whose derivatives fill vector registers: as ceres::Jet, with the same bits, but made to be inlined.
// Host only.
#pragma once

#include <cmath>
#include <cstddef>

namespace bms::arithmetic {

namespace dual_detail {

using Register [[gnu::vector_size(32)]] = double;
inline constexpr std::size_t width = sizeof(Register) / sizeof(double);

/// Members instead of an array, and copies of registers: g++ then keeps them in registers, without a detour by memory.
template <std::size_t Count>
struct Registers {
  alignas(sizeof(Register)) Register first;  // g++ without AVX would align it to half, and rely on all of it with AVX
  Registers<Count - 1> rest;

  Registers(const Register& a, const Registers<Count - 1>& b) : first(a), rest(b) {}
  Registers(const Registers& o) : first(o.first), rest(o.rest) {}
  Registers& operator=(const Registers& o) {
    first = o.first;
    rest = o.rest;
    return *this;
  }
  static Registers zero() { return {Register{}, Registers<Count - 1>::zero()}; }

  friend Registers operator+(const Registers& a, const Registers& b) { return {a.first + b.first, a.rest + b.rest}; }
  friend Registers operator-(const Registers& a, const Registers& b) { return {a.first - b.first, a.rest - b.rest}; }
  friend Registers operator-(const Registers& a) { return {-a.first, -a.rest}; }
  friend Registers operator*(const Registers& a, double x) { return {a.first * x, a.rest * x}; }
  friend bool operator==(const Registers& a, const Registers& b) {
    return a.first[0] == b.first[0] && a.first[1] == b.first[1] && a.first[2] == b.first[2] &&
           a.first[3] == b.first[3] && a.rest == b.rest;
  }
  double get(std::size_t k) const { return k < width ? first[k] : rest.get(k - width); }
  void set(std::size_t k, double x) {
    if (k < width)
      first[k] = x;
    else
      rest.set(k - width, x);
  }
};
template <>
struct Registers<0> {
  static Registers zero() { return {}; }
  friend Registers operator+(const Registers&, const Registers&) { return {}; }
  friend Registers operator-(const Registers&, const Registers&) { return {}; }
  friend Registers operator-(const Registers&) { return {}; }
  friend Registers operator*(const Registers&, double) { return {}; }
  friend bool operator==(const Registers&, const Registers&) { return true; }
  double get(std::size_t) const { return 0; }
  void set(std::size_t, double) {}
};

}  // namespace dual_detail

/// So many derivatives, and as many more as fill the last register.
constexpr std::size_t whole_registers(std::size_t derivatives) {
  return (derivatives + dual_detail::width - 1) / dual_detail::width * dual_detail::width;
}

/// N derivatives, N a multiple of 4. A register of four doubles becomes two of SSE2 where there is no AVX2.
template <std::size_t N>
class Derivatives {
  static_assert(N > 0 && N % dual_detail::width == 0);

 public:
  Derivatives() : in_(In::zero()) {}
  static constexpr std::size_t size() { return N; }
  double operator[](std::size_t k) const { return in_.get(k); }
  void set(std::size_t k, double x) { in_.set(k, x); }

  friend Derivatives operator+(const Derivatives& a, const Derivatives& b) { return Derivatives(a.in_ + b.in_); }
  friend Derivatives operator-(const Derivatives& a, const Derivatives& b) { return Derivatives(a.in_ - b.in_); }
  friend Derivatives operator-(const Derivatives& a) { return Derivatives(-a.in_); }
  friend Derivatives operator*(const Derivatives& a, double x) { return Derivatives(a.in_ * x); }
  friend Derivatives operator*(double x, const Derivatives& a) { return Derivatives(a.in_ * x); }
  Derivatives& operator*=(double x) { return *this = *this * x; }
  friend bool operator==(const Derivatives& a, const Derivatives& b) { return a.in_ == b.in_; }

 private:
  using In = dual_detail::Registers<N / dual_detail::width>;
  explicit Derivatives(const In& in) : in_(in) {}
  In in_;
};

/// A value and its derivatives by N unknowns.
template <std::size_t N>
struct DualNumber {
  double a = 0;
  Derivatives<N> v;

  DualNumber() = default;
  explicit DualNumber(double value) : a(value) {}
  /// Unknown k.
  DualNumber(double value, std::size_t k) : a(value) { v.set(k, 1); }
  DualNumber(double value, const Derivatives<N>& derivatives) : a(value), v(derivatives) {}

  friend DualNumber operator-(const DualNumber& f) { return {-f.a, -f.v}; }
  friend DualNumber operator+(const DualNumber& f, const DualNumber& g) { return {f.a + g.a, f.v + g.v}; }
  friend DualNumber operator+(const DualNumber& f, double s) { return {f.a + s, f.v}; }
  friend DualNumber operator+(double s, const DualNumber& f) { return f + s; }
  friend DualNumber operator-(const DualNumber& f, const DualNumber& g) { return {f.a - g.a, f.v - g.v}; }
  friend DualNumber operator-(const DualNumber& f, double s) { return {f.a - s, f.v}; }
  friend DualNumber operator-(double s, const DualNumber& f) { return {s - f.a, -f.v}; }
  friend DualNumber operator*(const DualNumber& f, const DualNumber& g) { return {f.a * g.a, f.a * g.v + f.v * g.a}; }
  friend DualNumber operator*(const DualNumber& f, double s) { return {f.a * s, f.v * s}; }
  friend DualNumber operator*(double s, const DualNumber& f) { return f * s; }
  friend DualNumber operator/(const DualNumber& f, const DualNumber& g) {
    const double inverse = 1 / g.a, ratio = f.a * inverse;
    return {ratio, (f.v - ratio * g.v) * inverse};
  }
  friend DualNumber operator/(double s, const DualNumber& g) { return {s / g.a, g.v * (-s / (g.a * g.a))}; }
  friend DualNumber operator/(const DualNumber& f, double s) { return f * (1 / s); }
  DualNumber& operator+=(const DualNumber& g) { return *this = *this + g; }
  DualNumber& operator-=(const DualNumber& g) { return *this = *this - g; }
  DualNumber& operator*=(const DualNumber& g) { return *this = *this * g; }
  DualNumber& operator+=(double s) { return *this = *this + s; }
  DualNumber& operator-=(double s) { return *this = *this - s; }
  DualNumber& operator*=(double s) { return *this = *this * s; }

  // by value alone
  friend bool operator==(const DualNumber& f, const DualNumber& g) { return f.a == g.a; }
  friend bool operator<(const DualNumber& f, const DualNumber& g) { return f.a < g.a; }
  friend bool operator>(const DualNumber& f, const DualNumber& g) { return f.a > g.a; }
  friend bool operator<=(const DualNumber& f, const DualNumber& g) { return f.a <= g.a; }
  friend bool operator>=(const DualNumber& f, const DualNumber& g) { return f.a >= g.a; }
  friend bool operator==(const DualNumber& f, double s) { return f.a == s; }
  friend bool operator<(const DualNumber& f, double s) { return f.a < s; }
  friend bool operator>(const DualNumber& f, double s) { return f.a > s; }
  friend bool operator<=(const DualNumber& f, double s) { return f.a <= s; }
  friend bool operator>=(const DualNumber& f, double s) { return f.a >= s; }

  friend DualNumber exp(const DualNumber& f) {
    const double value = std::exp(f.a);
    return {value, value * f.v};
  }
  friend DualNumber sqrt(const DualNumber& f) {
    const double value = std::sqrt(f.a);
    return {value, f.v * (1 / (2 * value))};
  }
};

}  // namespace bms::arithmetic
