#include "plant/circuit/circuit.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace bms::plant {
namespace {

constexpr std::size_t ground = Circuit::ground;

TEST(Circuit, DividesTheVoltageOfAnIdealSource) {
  Circuit circuit;
  const std::size_t top = circuit.add_node(), middle = circuit.add_node();
  const std::size_t source = circuit.add(Branch{.from = top, .to = ground, .emf_v = 50});
  circuit.add(Branch{.from = top, .to = middle, .resistance_ohm = 1e6});
  circuit.add(Branch{.from = middle, .to = ground, .resistance_ohm = 56e3});
  circuit.solve_now();
  EXPECT_NEAR(circuit.voltage_v(middle), 50 * 56e3 / 1'056e3, 1e-12);
  EXPECT_NEAR(circuit.current_a(source), -50 / 1'056e3, 1e-15);  // it delivers
}

/// Largest error of the voltage of a capacitor charged over a resistor, with steps of one length.
double error_of_rc_v(double step_s) {
  constexpr double source_v = 52, ohm = 50, farad = 0.01, tau_s = ohm * farad;
  Circuit circuit;
  const std::size_t node = circuit.add_node();
  circuit.add(Branch{.from = node, .to = ground, .resistance_ohm = ohm, .emf_v = source_v});
  const std::size_t capacitor = circuit.add(Branch{.from = node, .to = ground, .capacitance_f = farad});
  circuit.set_steps(step_s, step_s, 1);
  double worst_v = 0;
  while (circuit.time_s() < 3 * tau_s) {
    circuit.step(step_s);
    const double expected_v = source_v * (1 - std::exp(-circuit.time_s() / tau_s));
    worst_v = std::max(worst_v, std::abs(circuit.capacitor_v(capacitor) - expected_v));
  }
  return worst_v;
}

TEST(Circuit, ChargesACapacitorExponentiallyWithOrder2) {
  // Each step adds c (h / tau)^3 (V - v) with the error constant c = 0.0404 of the method; the sum is largest at tau.
  const double coarse_v = error_of_rc_v(0.02), fine_v = error_of_rc_v(0.01);
  EXPECT_NEAR(coarse_v, 0.0404 * 52 * 0.04 * 0.04 / std::numbers::e, 0.05 * coarse_v);
  EXPECT_NEAR(coarse_v / fine_v, 4, 0.2);
}

TEST(Circuit, ChargesACapacitorWithAdaptiveSteps) {
  constexpr double tau_s = 0.5;
  Circuit circuit;
  const std::size_t node = circuit.add_node();
  circuit.add(Branch{.from = node, .to = ground, .resistance_ohm = 50, .emf_v = 52});
  const std::size_t capacitor = circuit.add(Branch{.from = node, .to = ground, .capacitance_f = 0.01});
  circuit.advance(2);
  EXPECT_NEAR(circuit.time_s(), 2, 1e-9);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 52 * (1 - std::exp(-2 / tau_s)), 1e-5);
  EXPECT_LT(circuit.steps(), 2'200U);
}

TEST(Circuit, ShareOfTwoCapacitorsConservesChargeAndLosesTheKnownEnergy) {
  constexpr double first_f = 0.01, second_f = 0.001, start_v = 50, ohm = 0.02;
  Circuit circuit;
  const std::size_t left = circuit.add_node(), right = circuit.add_node();
  const std::size_t first = circuit.add(Branch{.from = left, .capacitance_f = first_f, .capacitor_v = start_v});
  const std::size_t second = circuit.add(Branch{.from = right, .capacitance_f = second_f});
  const std::size_t contact = circuit.add(Switch{.from = left, .to = right, .on_ohm = ohm});
  circuit.set_closed(contact, true);
  circuit.solve_now();
  EXPECT_NEAR(circuit.current_a(contact), start_v / ohm, 1e-6 * start_v / ohm);
  circuit.advance(0.01);
  const double common_v = first_f * start_v / (first_f + second_f);
  EXPECT_NEAR(circuit.capacitor_v(first), common_v, 1e-9);
  EXPECT_NEAR(circuit.capacitor_v(second), common_v, 1e-9);
  EXPECT_NEAR(circuit.charge_as(contact), second_f * common_v, 1e-12);
  // The time constant of 18 us is less than two of the shortest steps.
  const double lost_j = first_f * second_f / (first_f + second_f) * start_v * start_v / 2;
  EXPECT_NEAR(circuit.heat_j(contact), lost_j, 0.02 * lost_j);
}

TEST(Circuit, HeatOfASwitchedCapacitorConvergesToItsEnergy) {
  double last_error = 1;
  for (const double step_s : {8e-6, 4e-6, 2e-6, 1e-6}) {
    Circuit circuit;
    const std::size_t node = circuit.add_node();
    const std::size_t resistor = circuit.add(Branch{.from = node, .resistance_ohm = 0.015, .emf_v = 50});
    circuit.add(Branch{.from = node, .capacitance_f = 0.01});
    circuit.set_steps(step_s, step_s, 1);
    circuit.advance(3e-3);
    const double error = std::abs(circuit.heat_j(resistor) - 12.5) / 12.5;
    EXPECT_LT(error, last_error / 3.5) << step_s;
    last_error = error;
  }
  EXPECT_LT(last_error, 1e-5);
}

TEST(Circuit, OscillatesAtTheFrequencyOfLAndCAndKeepsItsEnergy) {
  constexpr double henry = 2e-6, farad = 0.01;
  const double omega = 1 / std::sqrt(henry * farad);
  Circuit circuit;
  const std::size_t node = circuit.add_node();
  const std::size_t capacitor = circuit.add(Branch{.from = node, .capacitance_f = farad, .capacitor_v = 10});
  const std::size_t coil = circuit.add(Branch{.from = node, .inductance_h = henry});
  circuit.set_steps(1e-6, 1e-6, 1e9);
  const double quarter_s = std::numbers::pi / 2 / omega;
  circuit.advance(quarter_s);
  EXPECT_NEAR(circuit.current_a(coil), 10 * std::sqrt(farad / henry), 0.1);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 0, 0.01);
  circuit.advance(3 * quarter_s);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 10, 0.01);
}

TEST(Circuit, DoesNotRingWhenASwitchShortsACapacitor) {
  Circuit circuit;
  const std::size_t node = circuit.add_node();
  const std::size_t capacitor = circuit.add(Branch{.from = node, .capacitance_f = 1e-6, .capacitor_v = 50});
  const std::size_t contact = circuit.add(Switch{.from = node, .to = ground, .on_ohm = 1e-3});
  circuit.advance(1e-3);
  circuit.set_closed(contact, true);
  // The step is z = 10'000 time constants. The method multiplies by -(1 - 2 gamma) / (gamma^2 z) = -4.83 / z, and
  // z is far from the rounding errors; the trapezoidal rule would multiply by -1.
  circuit.step(1e-5);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), -50 * 4.83 / 1e4, 1e-4);
  circuit.step(1e-5);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 0, 1e-4);
}

TEST(Circuit, DiodesLimitACurrentSourceToAVoltage) {
  Circuit circuit;
  const std::size_t inner = circuit.add_node(), limit = circuit.add_node(), output = circuit.add_node();
  const std::size_t source = circuit.add_current_source(ground, inner);
  circuit.add(Branch{.from = limit, .to = ground, .emf_v = 58.4});
  circuit.add(Diode{.from = inner, .to = limit});
  const std::size_t diode = circuit.add(Diode{.from = inner, .to = output, .forward_v = 0.7});
  const std::size_t capacitor = circuit.add(Branch{.from = output, .capacitance_f = 0.01});
  circuit.set_source_a(source, 10);
  circuit.advance(0.05);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 10 * 0.05 / 0.01, 0.01);  // constant current
  circuit.advance(0.05);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 57.7, 0.02);  // constant voltage
  circuit.set_source_a(source, 0);
  circuit.advance(0.05);
  EXPECT_FALSE(circuit.closed(diode));
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 57.7, 0.02);
}

TEST(Circuit, KeepsTheVoltageOfACapacitorThatFloatsBehindMegohms) {
  // The current through 100 S is the difference of two potentials that only 1 uS holds.
  Circuit circuit;
  const std::size_t plus = circuit.add_node(), minus = circuit.add_node();
  const std::size_t capacitor =
      circuit.add(Branch{.from = plus, .to = minus, .resistance_ohm = 0.01, .capacitance_f = 0.01, .capacitor_v = 50});
  circuit.add(Branch{.from = plus, .resistance_ohm = 1e6});
  circuit.add(Branch{.from = minus, .resistance_ohm = 1e6});
  circuit.advance(10);
  EXPECT_NEAR(circuit.capacitor_v(capacitor), 50 * std::exp(-10 / 20'000.0), 1e-6);
  EXPECT_NEAR(circuit.voltage_v(plus), 25 * std::exp(-10 / 20'000.0), 1e-4);
  EXPECT_NEAR(circuit.voltage_v(minus), -25 * std::exp(-10 / 20'000.0), 1e-4);
}

TEST(Circuit, StoresTheFactorsPerSwitchStateAndStep) {
  Circuit circuit;
  const std::size_t node = circuit.add_node();
  circuit.add(Branch{.from = node, .resistance_ohm = 1, .emf_v = 10});
  circuit.add(Branch{.from = node, .resistance_ohm = 0.1, .capacitance_f = 1e-3});
  const std::size_t contact = circuit.add(Switch{.from = node, .on_ohm = 1});
  for (int k = 0; k < 100; ++k) {
    circuit.set_closed(contact, k % 2 == 0);
    circuit.advance(0.1);
  }
  EXPECT_LT(circuit.factorisations(), 60U);
  EXPECT_GT(circuit.steps(), 5'000U);
}

}  // namespace
}  // namespace bms::plant
