// From the coefficients of the discrete transfer function (Eq. 11) to the circuit: slope of the OCV, R0, R1, C1; and
// back (Eq. 12-16).
//
//   tau = R1 C1 = T (1 + a2) / (2 (1 - a2))      D = 2 C_n T + 4 C_n tau
//   R0 = (c0 - c1 + c2) D / (16 C_n tau)          b1 = (c0 + c1 + c2) D / (4 T^2)
//   R1 = (c0 - c2) D / (4 C_n T) - R0 - b1 tau / C_n         C1 = tau / R1
//
// C_n is in coulombs here (Ah x 3600), b1 in volts per unit of SOC. a1 is not used: by Eq. 15 it is -(1 + a2), the pole
// at 1 that counts the charge. An identified a1 differs slightly; `integrator_pole_error` is that difference.
//
// Accuracy: b1 comes from the sum c0 + c1 + c2, which is about (T / tau) (T b1 / C_n) of R0. At 1 s a rounding error of
// 1e-16 is 1e-11 of b1.
//
// Eq. 12-16 are the bilinear transform, which holds for a current that is linear between samples (first-order hold).
// The current of a recording is a mean over the interval that ends with the sample (zero-order hold). For such data Eq.
// 12-16 give an R0 that is too large by R1 T / (2 tau) + b1 T / (2 C_n), an R1 that is too small by R1 T / (2 tau) (1 %
// at T = 1 s and tau = 50 s), and a tau that is too large by the factor 1 + (T / tau)^2 / 12.
// Intersample::zero_order_hold is exact for such data:
//   p = a2 = exp(-T / tau), R1 = R1' (1 + p) / (2 p), R0 = R0' - b1 T / (2 C_n) - R1 (1 - p) / (1 + p), R0' and R1'
//   those of Eq. 12-16.
//
// Delay (output error model, nk = 1): the paper uses b_1..b_3 of Eq. 21 in Eq. 12-16 as if there were no delay. So does
// this code: the delay counts as a dead time in series with the circuit. b1 and tau do not depend on it. R0 and R1 are
// right to about R1 T / tau if the voltage responds one sample late. Otherwise they have no exact meaning, because a
// model without direct feedthrough cannot represent R0.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace bms::identification {

struct CircuitParameters {
  double b1_v = 0;  ///< dOCV/dsoc [V] per unit of soc
  double r0_ohm = 0;
  double r1_ohm = 0;
  double c1_f = 0;
};

struct DiscreteCoefficients {
  double c0 = 0, c1 = 0, c2 = 0;  ///< [ohm]
  double a1 = 0, a2 = 0;
};

/// Course of the current between samples.
enum class Intersample {
  first_order_hold,  ///< Eq. 12-16
  zero_order_hold,   ///< mean over the interval that ends with the sample, as in a recording
};

/// Names in the order of CircuitParameters: b1_v, r0_ohm, r1_ohm, c1_f.
inline constexpr const char* circuit_names[] = {"b1_v", "r0_ohm", "r1_ohm", "c1_f"};

struct CircuitResult {
  CircuitParameters circuit;         ///< as the equations give it, never clamped
  double tau_s = 0;                  ///< R1 C1
  double integrator_pole_error = 0;  ///< distance of the nearest pole from 1; 0: exactly an integrator
  /// "r1_ohm is negative", "c1_f is not finite", "the poles are complex"; empty: a valid circuit.
  std::vector<std::string> implausible;
};

/// Eq. 12-16 solved for the circuit, for any coefficients. Throws std::invalid_argument unless step_s and capacity_c
/// [C] are positive and finite.
CircuitResult circuit_from_discrete(const DiscreteCoefficients& coefficients, double step_s, double capacity_c,
                                    Intersample input = Intersample::first_order_hold);

/// Eq. 12-16. Throws as above.
DiscreteCoefficients discrete_from_circuit(const CircuitParameters& circuit, double step_s, double capacity_c,
                                           Intersample input = Intersample::first_order_hold);

/// Covariance of b1, R0, R1, C1, in this order, from that of c0, c1, c2, a1, a2, linearised (delta method); derivatives
/// by complex step, exact to rounding. The linearisation does not hold for a large standard deviation: above a third
/// of the value it only means "large". Throws as above.
Eigen::Matrix4d circuit_covariance(const DiscreteCoefficients& coefficients,
                                   const Eigen::Matrix<double, 5, 5>& covariance, double step_s, double capacity_c,
                                   Intersample input = Intersample::first_order_hold);

/// Standard deviations: the square roots of its diagonal.
CircuitParameters circuit_std(const DiscreteCoefficients& coefficients, const Eigen::Matrix<double, 5, 5>& covariance,
                              double step_s, double capacity_c, Intersample input = Intersample::first_order_hold);

}  // namespace bms::identification
