// The standard normal distribution.
#pragma once

#include <cmath>
#include <numbers>

namespace bms::measurement {

/// Probability of more than x standard deviations above the mean.
inline double normal_tail(double x) { return 0.5 * std::erfc(x / std::numbers::sqrt2); }

/// What is exceeded with the probability 1 - p, 0 < p < 1; to 1e-9 between 1e-15 and 1 - 1e-15.
inline double normal_quantile(double p) {
  double from = -8, to = 8;
  while (to - from > 1e-9) {
    const double middle = 0.5 * (from + to);
    (normal_tail(-middle) < p ? from : to) = middle;
  }
  return 0.5 * (from + to);
}

}  // namespace bms::measurement
