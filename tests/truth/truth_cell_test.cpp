#include "plant/truth_cell.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "plant/instruments.hpp"
#include "plant/random.hpp"

namespace bms::plant {
namespace {

constexpr double ambient_c = 20;

MonotoneCurve flat(double value) { return MonotoneCurve({{0, value}, {1, value}}); }

/// Pulses in both directions and rests, of one second to one minute.
struct Pulse {
  double current_a, duration_s;
};
std::vector<Pulse> pulses(int count) {
  Random random(7);
  std::vector<Pulse> all;
  for (int k = 0; k < count; ++k)
    all.push_back({k % 3 == 0 ? 0 : 12 * random.uniform() - 6.5, 1 + std::floor(60 * random.uniform())});
  return all;
}

TEST(TruthOcv, EqualsTheTenLinesOfTable9ExceptAtItsTwoSharpCorners) {
  constexpr std::array b0_v = {2.871, 3.167, 3.181, 3.253, 3.281, 3.266, 3.152, 3.25, 3.314, 2.126};
  constexpr std::array b1_v = {3.35, 0.39, 0.32, 0.08, 0.01, 0.04, 0.23, 0.09, 0.01, 1.33};
  const MonotoneCurve ocv_v = table9_ocv_v();
  for (int k = 0; k < 1'000; ++k) {
    const double soc = (k + 0.5) / 1'000;
    const auto line = static_cast<std::size_t>(k / 100);
    double tolerance_v = 0.0015;
    if (std::abs(soc - 0.1) < 0.025) tolerance_v = 0.011;
    if (std::abs(soc - 0.9) < 0.01) tolerance_v = 0.0045;
    EXPECT_NEAR(ocv_v.at(soc), b0_v[line] + b1_v[line] * soc, tolerance_v) << soc;
  }
}

TEST(TruthOcv, RisesEverywhereWithAContinuousSlope) {
  const MonotoneCurve ocv_v = table9_ocv_v();
  constexpr double h = 1e-5;
  double slope_before_v = 0;
  for (double soc = -0.05; soc < 1.05; soc += h) {
    const double slope_v = (ocv_v.at(soc + h) - ocv_v.at(soc)) / h;
    ASSERT_GT(slope_v, 0) << soc;
    if (soc > -0.05) {
      ASSERT_NEAR(slope_v, slope_before_v, 0.01) << soc;
    }
    slope_before_v = slope_v;
  }
}

TEST(TruthCircuit, InterpolatesTable9WithoutOvershoot) {
  constexpr std::array r1_ohm = {0.027101,   0.012339,   0.00998571, 0.009014,   0.00825815,
                                 0.00771709, 0.00740307, 0.00777491, 0.00822862, 0.0072376};
  const CircuitCurves circuit = table9_circuit();
  EXPECT_DOUBLE_EQ(circuit.r0_ohm.at(0.1), 0.0140197);
  EXPECT_DOUBLE_EQ(circuit.c1_f.at(1.0), 1927.32);
  EXPECT_EQ(circuit.r1_ohm.at(0.03), circuit.r1_ohm.at(0.1));
  for (std::size_t k = 0; k + 1 < r1_ohm.size(); ++k) {
    EXPECT_NEAR(circuit.r1_ohm.at(static_cast<double>(k + 1) / 10), r1_ohm[k], 1e-12);
    for (double along = 0; along <= 1; along += 0.05) {
      const double value = circuit.r1_ohm.at((static_cast<double>(k + 1) + along) / 10);
      EXPECT_GE(value, std::fmin(r1_ohm[k], r1_ohm[k + 1]) - 1e-12);
      EXPECT_LE(value, std::fmax(r1_ohm[k], r1_ohm[k + 1]) + 1e-12);
    }
  }
}

TEST(TruthCell, ChangesItsSocByTheIntegralOfCurrentOverCapacity) {
  Cell cell({.capacity_ah = 5}, {.soc = 0.6});
  long double charge_as = 0;
  for (const Pulse& p : pulses(5'000)) {
    cell.run(p.current_a * 0.01, ambient_c, p.duration_s);
    charge_as += static_cast<long double>(p.current_a * 0.01) * p.duration_s;
  }
  ASSERT_GT(std::abs(charge_as), 50);
  // The rest is the rounding of soc itself.
  EXPECT_NEAR(cell.soc(), static_cast<double>(0.6L + charge_as / (3'600 * 5.0L)), 2e-16);
}

TEST(TruthCell, DoesNotLoseSmallCurrentsNextToALargeCharge) {
  Cell cell({.capacity_ah = 5, .step_s = 1}, {.soc = 0.9});
  cell.run(-2, ambient_c, 4'500);
  constexpr int count = 200'000;
  for (int k = 0; k < count; ++k) cell.run(1e-4, ambient_c, 1);
  // Plain summation is off by 8e-12.
  EXPECT_NEAR(cell.soc(), 0.9 - 0.5 + count * 1e-4 / (3'600 * 5), 2e-16);
}

TEST(TruthCell, HasItsOpenCircuitVoltageAfterALongRest) {
  Cell cell({}, {.soc = 0.7});
  cell.run(-5, ambient_c, 1'800);
  EXPECT_LT(cell.voltage_v(), table9_ocv_v().at(cell.soc()) - 0.09);
  cell.run(0, ambient_c, 3'600);
  EXPECT_NEAR(cell.soc(), 0.7 - 2.5 / 6, 1e-15);
  EXPECT_NEAR(cell.voltage_v(), table9_ocv_v().at(cell.soc()), 1e-12);
}

TEST(TruthCell, FollowsTheAnalyticStepResponse) {
  constexpr double r0_ohm = 0.013, r1_ohm = 0.008, c1_f = 1'400, current_a = 4, ocv_v = 3.2;
  Cell cell({.ocv_v = flat(ocv_v), .circuit = {flat(r0_ohm), flat(r1_ohm), flat(c1_f)}}, {.soc = 0.5});
  for (int second = 1; second <= 60; ++second) {
    cell.run(current_a, ambient_c, 1);
    const double v_rc_v = r1_ohm * current_a * (1 - std::exp(-second / (r1_ohm * c1_f)));
    // Runge-Kutta 4 with a step of 1/224 time constant: (1/224)^4 / 120 of the 32 mV, and rounding.
    ASSERT_NEAR(cell.v_rc_v(), v_rc_v, 1e-12) << second;
    ASSERT_NEAR(cell.voltage_v(), ocv_v + v_rc_v + r0_ohm * current_a, 1e-12) << second;
  }
}

TEST(TruthCell, ChangesByLessThanAMicrovoltWhenItsStepIsHalved) {
  const CellParameters coarse;
  CellParameters fine;
  fine.step_s = coarse.step_s / 2;
  Cell one(coarse, {.soc = 0.95}), other(fine, {.soc = 0.95});
  double largest_v = 0;
  for (const Pulse& p : pulses(1'500)) {
    one.run(p.current_a, ambient_c, p.duration_s);
    other.run(p.current_a, ambient_c, p.duration_s);
    largest_v = std::fmax(largest_v, std::abs(one.voltage_v() - other.voltage_v()));
  }
  EXPECT_LT(one.soc(), 0.4);
  EXPECT_LT(largest_v, 1e-6);
}

TEST(TruthCell, WarmsToItsSteadyStateAndThenCoolsExponentially) {
  constexpr double r0_ohm = 0.013, r1_ohm = 0.008, current_a = 5;
  const Thermal thermal{.heat_capacity_j_per_k = 100, .to_ambient_w_per_k = 0.2};
  Cell cell({.capacity_ah = 1e3, .circuit = {flat(r0_ohm), flat(r1_ohm), flat(100)}, .thermal = thermal},
            {.temperature_c = ambient_c});
  cell.run(current_a, ambient_c, 20'000);
  const double rise_k = current_a * current_a * (r0_ohm + r1_ohm) / thermal.to_ambient_w_per_k;
  EXPECT_NEAR(cell.temperature_c(), ambient_c + rise_k, 1e-9);
  cell.run(0, ambient_c, 10);  // the capacitor empties: its heat is worth 0.5 C1 v^2 = 80 mJ
  const double warm_k = cell.temperature_c() - ambient_c;
  cell.run(0, ambient_c, 500);
  EXPECT_NEAR(cell.temperature_c(), ambient_c + warm_k * std::exp(-1.0), 1e-9);
}

TEST(TruthCell, HasSixteenTimesTheResistanceInTheCold) {
  CellParameters p;
  p.over_temperature = lfp_in_the_cold();
  const auto drop_v = [&](double celsius) {
    Cell cell(p, {.soc = 0.5, .v_rc_v = 0, .temperature_c = celsius});
    const double rest_v = cell.voltage_v();
    cell.run(-1, celsius, 0.01);
    return rest_v - cell.voltage_v();
  };
  EXPECT_NEAR(drop_v(-30) / drop_v(25), 16.5, 0.05);
  EXPECT_NEAR(drop_v(45) / drop_v(25), 0.832, 0.002);
}

TEST(Random, IsNormalInItsFirstFourMoments) {
  Random random(3);
  constexpr int count = 200'000;
  double first = 0, second = 0, third = 0, fourth = 0;
  for (int k = 0; k < count; ++k) {
    const double n = random.normal();
    first += n / count;
    second += n * n / count;
    third += n * n * n / count;
    fourth += n * n * n * n / count;
  }
  EXPECT_NEAR(first, 0, 0.01);
  EXPECT_NEAR(second, 1, 0.01);
  EXPECT_NEAR(third, 0, 0.03);
  EXPECT_NEAR(fourth, 2.9, 0.05);  // 3 - 1.2 / 12 for a sum of twelve
}

TEST(Channel, ReadsGainErrorNoiseAndSteps) {
  Channel channel({.gain_error = 0.01, .noise_sigma = 0.02, .step = 0.005}, 1);
  constexpr int count = 50'000;
  double mean = 0, square = 0;
  for (int k = 0; k < count; ++k) {
    const double reading = channel.read(3, 1);
    ASSERT_NEAR(reading / 0.005, std::round(reading / 0.005), 1e-9);
    mean += reading / count;
    square += (reading - 3.03) * (reading - 3.03) / count;
  }
  EXPECT_NEAR(mean, 3.03, 0.0005);
  EXPECT_NEAR(std::sqrt(square), std::sqrt(0.02 * 0.02 + 0.005 * 0.005 / 12), 0.0005);
}

TEST(Channel, DriftsWithItsSigmaAndCorrelationTime) {
  constexpr double sigma = 0.015, correlation_s = 200;
  double square = 0, product = 0;
  constexpr int channels = 4'000;
  for (int seed = 0; seed < channels; ++seed) {
    Channel channel({.drift_sigma = sigma, .drift_correlation_s = correlation_s}, static_cast<unsigned>(seed));
    const double before = channel.drift();
    for (int k = 0; k < 200; ++k) channel.read(0, 1);
    square += channel.drift() * channel.drift() / channels;
    product += before * channel.drift() / channels;
  }
  EXPECT_NEAR(std::sqrt(square), sigma, 0.05 * sigma);
  EXPECT_NEAR(product / (sigma * sigma), std::exp(-1.0), 0.06);
}

TEST(Instruments, AreReproducibleBySeedAndHaveIndependentNoise) {
  Instruments one({}, 5), same({}, 5), other({}, 6);
  int equal = 0, shared = 0;
  for (int k = 0; k < 1'000; ++k) {
    const double reading = one.current_a.read(1, 1);
    ASSERT_EQ(reading, same.current_a.read(1, 1));
    equal += reading == other.current_a.read(1, 1);
  }
  EXPECT_LT(equal, 500);
  Channel current({.noise_sigma = 1}, 15), voltage({.noise_sigma = 1}, 16);
  for (int k = 0; k < 1'000; ++k) shared += std::abs(current.read(0, 1) - voltage.read(0, 1)) < 0.01;
  EXPECT_LT(shared, 20);
}

}  // namespace
}  // namespace bms::plant
