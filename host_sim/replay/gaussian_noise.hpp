// Reproducible normal noise: the same seed gives the same values on every machine, which std::normal_distribution does
// not guarantee.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "experiments/splitmix.hpp"

namespace bms::replay {

class GaussianNoise {
 public:
  explicit GaussianNoise(std::uint64_t seed) : random_(seed) {}

  /// A standard normal value (Box-Muller; the second value of the pair is not used).
  double next() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform())), angle = 2 * std::numbers::pi * uniform();
    return radius * std::cos(angle);
  }

 private:
  /// 0 <= u < 1.
  double uniform() { return static_cast<double>(random_.bits() >> 11) * 0x1p-53; }

  experiments::SplitMix random_;
};

}  // namespace bms::replay
