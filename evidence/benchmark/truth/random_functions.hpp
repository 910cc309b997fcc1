// Random draws in addition to evidence/plant/random.hpp, and smooth random functions. They use libm: the bits are the
// same on one machine, not on every machine.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <vector>

#include "plant/random.hpp"

namespace bms::benchmark::truth {

/// A seed that depends on both arguments.
inline std::uint64_t derived_seed(std::uint64_t a, std::uint64_t b) {
  return plant::Random(plant::Random(a).bits() ^ b).bits();
}

inline double between(plant::Random& random, double low, double high) { return low + (high - low) * random.uniform(); }
inline double log_between(plant::Random& random, double low, double high) {
  return low * std::exp(random.uniform() * std::log(high / low));
}
inline bool chance(plant::Random& random, double probability) { return random.uniform() < probability; }
inline std::size_t below(plant::Random& random, std::size_t count) {
  return static_cast<std::size_t>(random.uniform() * static_cast<double>(count));
}
inline double sign(plant::Random& random) { return chance(random, 0.5) ? 1 : -1; }

template <class Choices>
auto one_of(plant::Random& random, const Choices& choices) {
  return choices[below(random, choices.size())];
}

/// Sum of five waves over 0..1; slow waves are larger. RMS 1 over 0..1.
class SmoothRandom {
 public:
  explicit SmoothRandom(plant::Random& random) {
    for (std::size_t k = 0; k < waves; ++k) {
      size_[k] = random.normal() / (1.0 + 0.5 * static_cast<double>(k));
      phase_[k] = between(random, 0, 2 * std::numbers::pi);
    }
    constexpr int count = 200;
    double sum = 0;
    for (int k = 0; k <= count; ++k) sum += raw(k / double{count}) * raw(k / double{count});
    norm_ = 1 / std::sqrt(sum / (count + 1));
  }
  double at(double x) const { return norm_ * raw(x); }

 private:
  static constexpr std::size_t waves = 5;
  double raw(double x) const {
    double sum = 0;
    for (std::size_t k = 0; k < waves; ++k)
      sum += size_[k] * std::cos(std::numbers::pi * static_cast<double>(k + 1) * 0.9 * x + phase_[k]);
    return sum;
  }
  std::array<double, waves> size_{}, phase_{};
  double norm_ = 1;
};

/// Ornstein-Uhlenbeck process of standard deviation 1: count samples, step_s apart.
inline std::vector<double> ornstein_uhlenbeck(std::uint64_t seed, std::size_t count, double step_s,
                                              double correlation_s) {
  plant::Random random(seed);
  std::vector<double> values(count);
  const double kept = std::exp(-step_s / correlation_s), fresh = std::sqrt(1 - kept * kept);
  double value = random.normal();
  for (double& v : values) {
    v = value;
    value = kept * value + fresh * random.normal();
  }
  return values;
}

}  // namespace bms::benchmark::truth
