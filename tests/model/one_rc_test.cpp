#include "model/one_rc.hpp"

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/cells.hpp"

namespace bms::model {
namespace {

/// A cell with the same R0, R1, C1 everywhere, for which the step response is known in closed form.
CellParameters<> constant_cell() {
  CellParameters<> p = tests::table9;
  for (std::size_t k = 0; k < p.rc.soc.size; ++k) {
    p.rc.r0_ohm[k] = 0.013;
    p.rc.r1_ohm[k] = 0.02;
    p.rc.c1_f[k] = 1'000;
  }
  return p;
}

TEST(OneRc, FollowsTheExactStepResponseWhateverTheStepLength) {
  const auto cell = prepare<double, max_intervals>(constant_cell());
  for (const double step_s : {0.01, 0.7, 5.0, 20.0, 200.0}) {
    OneRc<double>::State x{0.03};
    const StepInput<double> input{-4, step_s};
    double time_s = 0;
    for (int k = 0; k < 50; ++k) {
      const auto at = look_up(cell, 0.5);
      x = OneRc<double>::advance(x, at, OneRc<double>::discretise(at, step_s), input);
      time_s += step_s;
      const double end_v = 0.02 * -4, expected_v = end_v + (0.03 - end_v) * std::exp(-time_s / 20);
      ASSERT_NEAR(x[0], expected_v, 1e-12) << "step " << step_s << " s, k = " << k;
    }
  }
}

TEST(OneRc, ChargingRaisesTheVoltageAtOnceByR0AndLaterByR1) {
  const auto cell = prepare<double, max_intervals>(constant_cell());
  const auto at = look_up(cell, 0.5);
  const StepInput<double> charge{5, 1'000};
  const double at_once_v = OneRc<double>::voltage({0}, at, charge) - at.ocv_v;
  const auto x = OneRc<double>::advance({0}, at, OneRc<double>::discretise(at, 1'000), charge);
  EXPECT_NEAR(at_once_v, 5 * 0.013, 1e-12);
  EXPECT_NEAR(OneRc<double>::voltage(x, at, charge) - at.ocv_v, 5 * (0.013 + 0.02), 1e-12);
}

/// Both analytic Jacobians against automatic differentiation, of states all over and on the interval edges themselves.
TEST(OneRc, AnalyticJacobiansAreTheDerivativesAt1000RandomStatesAndAllEdges) {
  using Jet = ceres::Jet<double, 2>;
  for (const CellParameters<>& p : {tests::table9, tests::a123_26650}) {
    const auto cell = prepare<double, max_intervals>(p);
    const auto jets = prepare<Jet, max_intervals>(p);
    std::mt19937 random(7);
    std::uniform_real_distribution<double> uniform(0, 1);
    std::vector<double> socs(1'000);
    for (double& soc : socs) soc = -0.1 + 1.2 * uniform(random);
    for (std::size_t k = 0; k < p.ocv.soc.size; ++k) socs.push_back(p.ocv.soc[k]);
    for (std::size_t k = 0; k < p.rc.soc.size; ++k) socs.push_back(p.rc.soc[k]);

    for (const double soc : socs) {
      const double v_rc = 0.2 * (uniform(random) - 0.5), current = p.capacity_ah * 6 * (uniform(random) - 0.5),
                   duration = std::pow(10, 3 * uniform(random) - 2);
      const auto at = look_up(cell, soc);
      const auto discretisation = OneRc<double>::discretise(at, duration);
      const auto f = OneRc<double>::state_transition({v_rc}, at, discretisation, {current, duration});
      const auto h = OneRc<double>::measurement_jacobian(at, {current, duration});

      const Jet v_rc_j(v_rc, 0), soc_j(soc, 1);
      const auto at_j = look_up(jets, soc_j);
      const StepInput<Jet> input_j{Jet(current), Jet(duration)};
      const auto x_j = OneRc<Jet>::advance({v_rc_j}, at_j, OneRc<Jet>::discretise(at_j, input_j.duration_s), input_j);
      ASSERT_NEAR(f[0][0], x_j[0].v[0], 1e-13) << "soc " << soc;
      ASSERT_NEAR(f[0][1], x_j[0].v[1], 1e-12 * (1 + std::abs(f[0][1]))) << "soc " << soc;
      ASSERT_EQ(f[1][0], 0);
      ASSERT_EQ(f[1][1], 1);
      const Jet v_j = OneRc<Jet>::voltage({v_rc_j}, at_j, input_j);
      ASSERT_NEAR(h[0], v_j.v[0], 1e-13) << "soc " << soc;
      ASSERT_NEAR(h[1], v_j.v[1], 1e-12 * (1 + std::abs(h[1]))) << "soc " << soc;
    }
  }
}

template <class S>
void expect_close_to_double(double tolerance_v) {
  const CellParameters<> p = tests::table9;
  const auto cell = prepare<S, max_intervals>(p);
  const auto reference = prepare<double, max_intervals>(p);
  for (const double soc : {-0.05, 0.0, 0.03, 0.1, 0.47, 0.8, 0.99, 1.05}) {
    for (const double current : {-18.0, -0.01, 0.0, 6.0}) {
      for (const double duration : {0.01, 1.0, 60.0, 4'000.0}) {
        const auto at = look_up(cell, Soc<S>(soc));
        const auto at_d = look_up(reference, soc);
        const StepInput<S> input{Current<S>(current), TimeStep<S>(duration)};
        const auto x = OneRc<S>::advance({Voltage<S>(0.02)}, at, OneRc<S>::discretise(at, input.duration_s), input);
        const auto x_d =
            OneRc<double>::advance({0.02}, at_d, OneRc<double>::discretise(at_d, duration), {current, duration});
        EXPECT_NEAR(as_double(OneRc<S>::voltage(x, at, input)), OneRc<double>::voltage(x_d, at_d, {current, duration}),
                    tolerance_v)
            << "soc " << soc << " current " << current << " duration " << duration;
      }
    }
  }
}

// float: 24 bits of 3.3 V are 0.2 uV, a few roundings; fixed point: 4 nV, but time and rate in 32 bits
TEST(OneRc, FloatComputesTheSameVoltageWithin2uV) { expect_close_to_double<float>(2e-6); }
TEST(OneRc, FixedPointComputesTheSameVoltageWithin2uV) { expect_close_to_double<FixedPoint>(2e-6); }

}  // namespace
}  // namespace bms::model
