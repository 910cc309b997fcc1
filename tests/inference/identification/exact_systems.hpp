// Systems of the class of the Hammerstein-Wiener model, drawn without a fit: the truth for its tests and figures.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <utility>
#include <vector>

#include "identification/circuit_from_discrete.hpp"
#include "identification/hammerstein_wiener.hpp"

namespace bms::identification {

/// Pulses of random size and length, every second. Without a voltage.
inline Data random_pulses(std::uint64_t seed, std::size_t count) {
  std::mt19937_64 random(seed);
  Data data;
  data.capacity_ah = 6;
  double current_a = 0;
  std::size_t left = 0;
  for (std::size_t k = 0; k < count; ++k) {
    if (left-- == 0) {
      left = 5 + random() % 60;
      current_a = -6 + 12 * static_cast<double>(random() % 1'000) / 1'000;
    }
    data.time_s.edit().push_back(static_cast<double>(k));
    data.current_a.edit().push_back(current_a);
    data.voltage_v.edit().push_back(0);
  }
  return data;
}

inline Data with_noise(Data data, std::uint64_t seed, double noise_v) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  for (double& v : data.voltage_v.edit()) v += noise_v * normal(random);
  return data;
}

struct ExactSystem {
  HammersteinWiener model;
  Data data;  ///< its voltage has no noise
};

/// Circuit, curves, and where the corners lie are drawn. ocv: the curve on the output follows its shape around 50 %.
inline ExactSystem exact_system(std::uint64_t seed, std::size_t count, const model::OcvTable<double>& ocv) {
  ExactSystem s;
  s.data = random_pulses(seed, count);
  std::mt19937_64 random(1'000'003 * seed + 5);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() % 1'000'000) / 1e6;
  };
  const double r0_ohm = between(0.008, 0.016), r1_ohm = between(0.005, 0.015), tau_s = 8 * std::pow(7, between(0, 1));
  const DiscreteCoefficients c = discrete_from_circuit({between(0.1, 0.6), r0_ohm, r1_ohm, tau_s / r1_ohm}, 1,
                                                       3'600 * s.data.capacity_ah, Intersample::zero_order_hold);
  const DiscreteModel linear{{c.c0, c.c1, c.c2}, {c.a1, c.a2}, 1, 3.2, {0, 0}};
  const BeyondData beyond{between(0, 1), between(0, 1)};
  s.model = begin_hammerstein_wiener(linear, output_error(), ocv, s.data, 0.5, beyond);
  s.model.input.direction = between(-0.08, 0.08);
  s.model.input.growth = between(-0.08, 0.08);
  for (double& y_v : s.model.output.y_v) y_v += between(-0.007, 0.007);
  const Eigen::VectorXd v = simulate(s.model, s.data.current_a);
  s.data.voltage_v = std::vector<double>(v.begin(), v.end());
  return s;
}

}  // namespace bms::identification
