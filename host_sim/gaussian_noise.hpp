// Reproducible normal noise: the same seed gives the same values on every machine (std::normal_distribution does not promise that).
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace bms {

class GaussianNoise {
 public:
  explicit GaussianNoise(std::uint64_t seed) : state_(seed) {}

  /// Standard normal; Box-Muller, one of the pair.
  double next() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform())), angle = 2 * std::numbers::pi * uniform();
    return radius * std::cos(angle);
  }

 private:
  /// 0 <= u < 1, splitmix64.
  double uniform() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15U;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
    return static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
  }

  std::uint64_t state_;
};

}  // namespace bms
