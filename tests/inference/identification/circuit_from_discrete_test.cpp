#include "identification/circuit_from_discrete.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

namespace bms::identification {
namespace {

constexpr double capacity_c = 6 * 3'600;  // the paper's cell
constexpr double epsilon = std::numeric_limits<double>::epsilon();

TEST(CircuitFromDiscrete, ForwardIsEq12To16AsPrinted) {
  const double b1 = 0.13, r0 = 0.0126, r1 = 0.0192, c1 = 8333.33, t = 10, cn = capacity_c;
  const DiscreteCoefficients c = discrete_from_circuit({b1, r0, r1, c1}, t, cn);
  const double below = 2 * cn * t + 4 * cn * r1 * c1;
  EXPECT_NEAR(c.c0,
              (t * t * b1 + 2 * cn * r0 * t + 2 * cn * r1 * t + 4 * cn * r0 * r1 * c1 + 2 * b1 * r1 * c1 * t) / below,
              1e-16);
  EXPECT_NEAR(c.c1, (t * t * b1 - 4 * cn * r0 * r1 * c1) / (cn * t + 2 * cn * r1 * c1), 1e-16);
  EXPECT_NEAR(c.c2,
              (t * t * b1 - 2 * cn * r0 * t - 2 * cn * r1 * t + 4 * cn * r0 * r1 * c1 - 2 * b1 * r1 * c1 * t) / below,
              1e-16);
  EXPECT_NEAR(c.a1, -8 * cn * r1 * c1 / below, 1e-15);
  EXPECT_NEAR(c.a2, (-2 * cn * t + 4 * cn * r1 * c1) / below, 1e-15);
  EXPECT_NEAR(c.a1, -(1 + c.a2), 1e-15);
}

// Eq. 10 with s = 2/T (1 - z^-1)/(1 + z^-1), at three points of z: independent of the algebra of the paper.
TEST(CircuitFromDiscrete, ForwardIsTheBilinearTransformOfEq10) {
  const double b1 = 0.13, r0 = 0.0126, r1 = 0.0192, c1 = 2000, t = 1, cn = capacity_c;
  const DiscreteCoefficients c = discrete_from_circuit({b1, r0, r1, c1}, t, cn);
  for (const double z : {2.0, -3.0, 1.1}) {
    const double s = 2 / t * (1 - 1 / z) / (1 + 1 / z);
    const double eq10 =
        (r0 * s * s + (b1 / cn + 1 / c1 + r0 / (r1 * c1)) * s + b1 / (r1 * c1 * cn)) / (s * (s + 1 / (r1 * c1)));
    EXPECT_NEAR((c.c0 + c.c1 / z + c.c2 / z / z) / (1 + c.a1 / z + c.a2 / z / z), eq10, 1e-12) << z;
  }
}

TEST(CircuitFromDiscrete, ComesBackTo1e12OverTheBoundsOfTable3) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(0, 1);
  const auto between = [&](double low, double high) { return low * std::pow(high / low, u(random)); };
  for (int trial = 0; trial < 2'000; ++trial) {
    const double t = between(0.1, 60), cn = between(2, 100) * 3'600;
    const CircuitParameters in{between(0.01, 3), between(1e-3, 0.1), between(1e-3, 0.5), between(100, 50'000)};
    for (const Intersample input : {Intersample::first_order_hold, Intersample::zero_order_hold}) {
      const DiscreteCoefficients c = discrete_from_circuit(in, t, cn);
      if (input == Intersample::zero_order_hold && t > 5 * in.r1_ohm * in.c1_f)
        continue;  // exp(-T/tau): nothing of the pole left in the sample after
      const DiscreteCoefficients shaped = discrete_from_circuit(in, t, cn, input);
      const CircuitResult back = circuit_from_discrete(shaped, t, cn, input);
      const CircuitParameters& out = back.circuit;
      const double tau = in.r1_ohm * in.c1_f, d_by_4cn = t / 2 + tau;
      // What the rounding of coefficients of size |c| and 1 - a2 costs, four ulp of them; 1e-12 of the value where that
      // is more.
      const double size = std::abs(c.c0) + std::abs(c.c1) + std::abs(c.c2), ulp = 4 * epsilon;
      const double pole = 1e-12 + ulp * (1 + tau / t);
      const double b1_error = ulp * size * d_by_4cn * cn / (t * t),
                   r1_error = ulp * size * d_by_4cn / t + 2 * b1_error * tau / cn;
      EXPECT_NEAR(out.b1_v, in.b1_v, pole * in.b1_v + b1_error);
      EXPECT_NEAR(out.r0_ohm, in.r0_ohm,
                  10 * pole * (in.r0_ohm + in.r1_ohm) + ulp * size * (1 + t / tau) +
                      (input == Intersample::zero_order_hold ? b1_error * t / cn + r1_error * t / tau : 0));
      EXPECT_NEAR(out.r1_ohm, in.r1_ohm, 10 * pole * (in.r0_ohm + in.r1_ohm) * (1 + t / tau) + 10 * r1_error);
      EXPECT_NEAR(out.c1_f * out.r1_ohm, tau, pole * tau * (1 + t / tau));
      EXPECT_TRUE(back.implausible.empty());
      EXPECT_LT(back.integrator_pole_error, ulp * (1 + tau / t));  // F(1) over 1 - p = T / tau
    }
  }
}

TEST(CircuitFromDiscrete, ComesBackTo1e12AtThePapersCellAndTenSeconds) {
  const CircuitParameters in{0.13, 0.0126, 0.0192, 8333.33};
  for (const Intersample input : {Intersample::first_order_hold, Intersample::zero_order_hold}) {
    const CircuitParameters out =
        circuit_from_discrete(discrete_from_circuit(in, 10, capacity_c, input), 10, capacity_c, input).circuit;
    EXPECT_NEAR(out.b1_v, in.b1_v, 1e-12 * 0.13 * 10);  // of c's of 0.0126, b1 is 1e-5 of: 1e-16 / 1e-5
    EXPECT_NEAR(out.r0_ohm, in.r0_ohm, 1e-12 * in.r0_ohm);
    EXPECT_NEAR(out.r1_ohm, in.r1_ohm, 1e-12 * in.r1_ohm);
    EXPECT_NEAR(out.c1_f, in.c1_f, 1e-12 * in.c1_f);
  }
}

// By hand: T = 1, C_n = 1, b1 = 1, R0 = 1, R1 = 1, C1 = 1: tau = 1, D = 6, c = (1 + 2 + 2 + 4 + 2, 2 - 8, 1 - 2 - 2 + 4
// - 2) / 6, a = (-8, 2) / 6.
TEST(CircuitFromDiscrete, GivesOnesForTheCoefficientsOfOnes) {
  const CircuitResult r = circuit_from_discrete({11.0 / 6, -1, -1.0 / 6, -8.0 / 6, 2.0 / 6}, 1, 1);
  EXPECT_NEAR(r.circuit.b1_v, 1, 1e-14);
  EXPECT_NEAR(r.circuit.r0_ohm, 1, 1e-14);
  EXPECT_NEAR(r.circuit.r1_ohm, 1, 1e-14);
  EXPECT_NEAR(r.circuit.c1_f, 1, 1e-14);
  EXPECT_NEAR(r.tau_s, 1, 1e-14);
}

// What Eq. 17 says of R0 and R1 by Eq. 12-16, T and b1 aside (R0 and R1 - its b1 part need neither): 12.4 mohm, where
// the paper has 11.9; and R1 + b1 tau / C_n = 8.2 mohm, where the paper has 1.3. Its R1 and C1 are not those of its
// coefficients.
TEST(CircuitFromDiscrete, GivesAnotherR1ForEq17ThanThePaper) {
  const CircuitResult r = circuit_from_discrete({0.01317, -0.02263, 0.00946, -1.82, 0.8203}, 1, capacity_c);
  EXPECT_NEAR(r.circuit.r0_ohm, 0.01243, 1e-5);
  EXPECT_NEAR(r.circuit.r1_ohm + r.circuit.b1_v * r.tau_s / capacity_c, 0.00822, 1e-5);
  EXPECT_NEAR(r.integrator_pole_error, 0.0017, 1e-4);  // F(1) = 0.0003, the other pole 0.18 away
}

/// The circuit under a zero-order hold, sample by sample, from Eq. 2 and 9 with exact exponentials.
TEST(CircuitFromDiscrete, ZeroOrderHoldIsTheCircuitWithAConstantCurrentInEachInterval) {
  const CircuitParameters in{0.4, 0.012, 0.02, 1'500};
  const double t = 5, pole = std::exp(-t / (in.r1_ohm * in.c1_f));
  const DiscreteCoefficients c = discrete_from_circuit(in, t, capacity_c, Intersample::zero_order_hold);
  const double current_a[] = {1, -2, 0, 0, 5, 5, 5, -1};
  double soc = 0, v_rc = 0, y1 = 0, y2 = 0, u1 = 0, u2 = 0;
  for (const double u : current_a) {
    soc += t * u / capacity_c;
    v_rc = pole * v_rc + in.r1_ohm * (1 - pole) * u;
    const double y = c.c0 * u + c.c1 * u1 + c.c2 * u2 - c.a1 * y1 - c.a2 * y2;
    ASSERT_NEAR(y, in.b1_v * soc + v_rc + in.r0_ohm * u, 1e-14);
    y2 = y1;
    y1 = y;
    u2 = u1;
    u1 = u;
  }
}

// The header's figures of what Eq. 12-16 make of a held current.
TEST(CircuitFromDiscrete, Eq12To16OnZeroOrderHoldDataMoveR0AndR1ByHalfAStepOverTau) {
  const CircuitParameters in{0.4, 0.012, 0.02, 2'500};  // tau = 50 s
  const CircuitResult r =
      circuit_from_discrete(discrete_from_circuit(in, 1, capacity_c, Intersample::zero_order_hold), 1, capacity_c);
  EXPECT_NEAR(r.circuit.r0_ohm - in.r0_ohm, in.r1_ohm / 100 + 0.4 / 2 / capacity_c, 1e-8);
  EXPECT_NEAR(r.circuit.r1_ohm - in.r1_ohm, -in.r1_ohm / 100, 2e-8);
  EXPECT_NEAR(r.tau_s / 50 - 1, 1.0 / 2'500 / 12, 1e-8);
  EXPECT_NEAR(r.circuit.b1_v, in.b1_v, 1e-8);
}

TEST(CircuitFromDiscrete, NamesNegativeInfiniteAndComplexResultsAndDoesNotClampThem) {
  using testing::Contains;
  const DiscreteCoefficients good = discrete_from_circuit({0.13, 0.0126, 0.0192, 8333}, 1, capacity_c);
  DiscreteCoefficients c = good;
  c.c2 += 0.002;  // negative R1
  const CircuitResult negative = circuit_from_discrete(c, 1, capacity_c);
  EXPECT_LT(negative.circuit.r1_ohm, 0);
  EXPECT_LT(negative.circuit.c1_f, 0);
  EXPECT_THAT(negative.implausible, Contains("r1_ohm is negative"));
  EXPECT_THAT(negative.implausible, Contains("c1_f is negative"));

  c = good;
  c.a2 = 1;  // no relaxation at all
  const CircuitResult infinite = circuit_from_discrete(c, 1, capacity_c);
  EXPECT_THAT(infinite.implausible, Contains("tau_s is not finite"));
  EXPECT_THAT(infinite.implausible, Contains("b1_v is not finite"));

  c = good;
  c.a1 = -1.6;
  c.a2 = 0.8;
  const CircuitResult oscillating = circuit_from_discrete(c, 1, capacity_c);
  EXPECT_THAT(oscillating.implausible, Contains(testing::HasSubstr("complex")));
  EXPECT_NEAR(oscillating.integrator_pole_error, std::hypot(0.2, 0.4), 1e-12);

  c.a1 = -0.9;
  c.a2 = -0.1;  // a negative pole, which no circuit with zero-order hold has
  EXPECT_THAT(circuit_from_discrete(c, 1, capacity_c, Intersample::zero_order_hold).implausible,
              Contains("tau_s is not finite"));
  EXPECT_THAT(circuit_from_discrete(good, 1, capacity_c).implausible, testing::IsEmpty());
}

TEST(CircuitFromDiscrete, RejectsATimeOrCapacityThatIsNotPositive) {
  for (const double bad : {0.0, -1.0, std::nan(""), double{INFINITY}}) {
    EXPECT_THROW(circuit_from_discrete({}, bad, 1), std::invalid_argument);
    EXPECT_THROW(circuit_from_discrete({}, 1, bad), std::invalid_argument);
    EXPECT_THROW(discrete_from_circuit({}, bad, 1), std::invalid_argument);
    EXPECT_THROW(circuit_covariance({}, Eigen::Matrix<double, 5, 5>::Identity(), 1, bad), std::invalid_argument);
  }
}

TEST(CircuitCovariance, IsWhatCentralDifferencesGive) {
  for (const Intersample input : {Intersample::first_order_hold, Intersample::zero_order_hold}) {
    const double t = 10;
    const DiscreteCoefficients c = discrete_from_circuit({0.4, 0.0126, 0.0192, 2'000}, t, capacity_c, input);
    Eigen::Matrix<double, 4, 5> slope;
    for (int j = 0; j < 5; ++j) {
      const double h = 1e-7;
      const auto moved = [&](double by) {
        DiscreteCoefficients x = c;
        *std::array{&x.c0, &x.c1, &x.c2, &x.a1, &x.a2}[static_cast<std::size_t>(j)] += by;
        const CircuitParameters r = circuit_from_discrete(x, t, capacity_c, input).circuit;
        return Eigen::Vector4d{r.b1_v, r.r0_ohm, r.r1_ohm, r.c1_f};
      };
      slope.col(j) = (moved(h) - moved(-h)) / (2 * h);
    }
    Eigen::Matrix<double, 5, 5> root;
    root << 3, 0, 0, 0, 0, -5, 1, 0, 0, 0, 2, -1, 0.2, 0, 0, 1, 2, 3, 4, 0, 5, -4, 3, -2, 1;
    const Eigen::Matrix<double, 5, 5> covariance = 1e-12 * root * root.transpose();
    const Eigen::Matrix4d ours = circuit_covariance(c, covariance, t, capacity_c, input),
                          theirs = slope * covariance * slope.transpose();
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j)
        EXPECT_NEAR(ours(i, j), theirs(i, j), 1e-5 * std::sqrt(theirs(i, i) * theirs(j, j))) << i << j;
    }
    const CircuitParameters deviation = circuit_std(c, covariance, t, capacity_c, input);
    EXPECT_EQ(deviation.b1_v, std::sqrt(ours(0, 0)));
    EXPECT_EQ(deviation.c1_f, std::sqrt(ours(3, 3)));
  }
}

TEST(CircuitCovariance, IsTheSpreadOfReadingsFromScatteredCoefficients) {
  const DiscreteCoefficients c = discrete_from_circuit({0.4, 0.0126, 0.0192, 2'000}, 10, capacity_c);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0, 1e-6);
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();
  const CircuitParameters at = circuit_from_discrete(c, 10, capacity_c).circuit;
  constexpr int trials = 20'000;
  for (int k = 0; k < trials; ++k) {
    const CircuitParameters r = circuit_from_discrete({c.c0 + noise(random), c.c1 + noise(random), c.c2 + noise(random),
                                                       c.a1, c.a2 + noise(random)},
                                                      10, capacity_c)
                                    .circuit;
    squares +=
        Eigen::Vector4d{r.b1_v - at.b1_v, r.r0_ohm - at.r0_ohm, r.r1_ohm - at.r1_ohm, r.c1_f - at.c1_f}.cwiseAbs2();
  }
  Eigen::Matrix<double, 5, 5> covariance = 1e-12 * Eigen::Matrix<double, 5, 5>::Identity();
  const Eigen::Vector4d expected = circuit_covariance(c, covariance, 10, capacity_c).diagonal();
  for (int k = 0; k < 4; ++k)
    EXPECT_NEAR(std::sqrt(squares[k] / trials / expected[k]), 1, 0.03) << circuit_names[k];  // 1/sqrt(2 trials) = 0.5 %
}

}  // namespace
}  // namespace bms::identification
