#include "identification/circuit_from_discrete.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <stdexcept>

namespace bms::identification {

namespace {

void require(double step_s, double capacity_c) {
  if (!(step_s > 0 && std::isfinite(step_s))) throw std::invalid_argument("the sampling time must be positive");
  if (!(capacity_c > 0 && std::isfinite(capacity_c))) throw std::invalid_argument("the capacity must be positive");
}

template <class Scalar>
Scalar zoh_tau(const Scalar& pole, double step_s) {
  using std::log;
  return -step_s / log(pole);
}

/// b1, R0, R1, C1 of c0, c1, c2, a1, a2; Scalar: double, or complex for the derivatives.
template <class Scalar>
std::array<Scalar, 4> backwards(const std::array<Scalar, 5>& x, double step_s, double capacity_c, Intersample input) {
  const auto& [c0, c1, c2, a1, a2] = x;
  const Scalar tau = step_s * (1.0 + a2) / (2.0 * (1.0 - a2));
  const Scalar d = 2 * capacity_c * step_s + 4 * capacity_c * tau;
  const Scalar b1 = (c0 + c1 + c2) * d / (4 * step_s * step_s);
  const Scalar r0 = (c0 - c1 + c2) * d / (16 * capacity_c * tau);
  const Scalar r1 = (c0 - c2) * d / (4 * capacity_c * step_s) - r0 - b1 * tau / capacity_c;
  if (input == Intersample::first_order_hold) return {b1, r0, r1, tau / r1};
  const Scalar& p = a2;
  const Scalar zoh_r1 = r1 * (1.0 + p) / (2.0 * p);
  return {b1, r0 - b1 * step_s / (2 * capacity_c) - zoh_r1 * (1.0 - p) / (1.0 + p), zoh_r1,
          zoh_tau(p, step_s) / zoh_r1};
}

/// Roots of z^2 + a1 z + a2; the smaller one from the product, because a subtraction would lose its digits.
std::array<std::complex<double>, 2> poles(double a1, double a2) {
  const std::complex<double> root = std::sqrt(std::complex<double>(a1 * a1 / 4 - a2));
  const std::complex<double> larger = -a1 / 2 + (a1 > 0 ? -root : root);
  return {larger, larger == 0.0 ? larger : a2 / larger};
}

}  // namespace

CircuitResult circuit_from_discrete(const DiscreteCoefficients& c, double step_s, double capacity_c,
                                    Intersample input) {
  require(step_s, capacity_c);
  const auto values = backwards<double>({c.c0, c.c1, c.c2, c.a1, c.a2}, step_s, capacity_c, input);
  const auto [one, other] = poles(c.a1, c.a2);
  CircuitResult out;
  out.circuit = {values[0], values[1], values[2], values[3]};
  out.tau_s = input == Intersample::zero_order_hold ? zoh_tau(c.a2, step_s) : step_s * (1 + c.a2) / (2 * (1 - c.a2));
  out.integrator_pole_error = std::min(std::abs(1.0 - one), std::abs(1.0 - other));

  const auto judge = [&](const char* name, double value) {
    if (!std::isfinite(value))
      out.implausible.push_back(std::string(name) + " is not finite");
    else if (value < 0)
      out.implausible.push_back(std::string(name) + " is negative");
    else if (value == 0)
      out.implausible.push_back(std::string(name) + " is zero");
  };
  for (std::size_t k = 0; k < values.size(); ++k) judge(circuit_names[k], values[k]);
  judge("tau_s", out.tau_s);
  if (one.imag() != 0) out.implausible.emplace_back("the poles are complex, which such a circuit cannot have");
  return out;
}

DiscreteCoefficients discrete_from_circuit(const CircuitParameters& circuit, double step_s, double capacity_c,
                                           Intersample input) {
  require(step_s, capacity_c);
  const auto& [b1, r0, r1, c1] = circuit;
  const double t = step_s, q = capacity_c, tau = r1 * c1, d = 2 * q * t + 4 * q * tau;
  if (input == Intersample::zero_order_hold) {  // R0 + b1 T / C_n / (1 - z^-1) + R1 (1 - p) / (1 - p z^-1)
    const double p = std::exp(-t / tau), counted = b1 * t / q, relaxed = -r1 * std::expm1(-t / tau);
    return {r0 + counted + relaxed, -r0 * (1 + p) - counted * p - relaxed, r0 * p, -(1 + p), p};
  }
  const double even = t * t * b1 + 4 * q * r0 * tau, odd = 2 * q * t * (r0 + r1) + 2 * b1 * tau * t;
  return {(even + odd) / d, 2 * (t * t * b1 - 4 * q * r0 * tau) / d, (even - odd) / d, -8 * q * tau / d,
          (4 * q * tau - 2 * q * t) / d};
}

Eigen::Matrix4d circuit_covariance(const DiscreteCoefficients& c, const Eigen::Matrix<double, 5, 5>& covariance,
                                   double step_s, double capacity_c, Intersample input) {
  require(step_s, capacity_c);
  constexpr double tiny = 1e-100;  // complex step: it needs no difference, so rounding does not depend on its size
  Eigen::Matrix<double, 4, 5> slope;
  for (std::size_t j = 0; j < 5; ++j) {
    std::array<std::complex<double>, 5> x{c.c0, c.c1, c.c2, c.a1, c.a2};
    x[j] += std::complex<double>(0, tiny);
    const auto values = backwards(x, step_s, capacity_c, input);
    for (std::size_t k = 0; k < 4; ++k)
      slope(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) = values[k].imag() / tiny;
  }
  return slope * covariance * slope.transpose();
}

CircuitParameters circuit_std(const DiscreteCoefficients& c, const Eigen::Matrix<double, 5, 5>& covariance,
                              double step_s, double capacity_c, Intersample input) {
  const Eigen::Vector4d variance = circuit_covariance(c, covariance, step_s, capacity_c, input).diagonal();
  const auto root = [&](Eigen::Index k) { return std::sqrt(std::max(0.0, variance[k])); };
  return {root(0), root(1), root(2), root(3)};
}

}  // namespace bms::identification
