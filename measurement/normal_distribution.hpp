// The standard normal distribution.
#pragma once

#include <cmath>
#include <numbers>

namespace bms::measurement {

/// Probability of more than x standard deviations above the mean.
inline double normal_tail(double x) { return 0.5 * std::erfc(x / std::numbers::sqrt2); }

/// What is exceeded with the probability 1 - p, 1e-15 < p < 1 - 1e-15; to 1e-9 and, near 1, to what p itself has left
/// of its digits.
inline double normal_quantile(double p) {
  if (p > 0.5) return -normal_quantile(1 - p);
  double from = -8, to = 0;
  while (to - from > 1e-9) {
    const double middle = 0.5 * (from + to);
    (normal_tail(-middle) < p ? from : to) = middle;
  }
  return 0.5 * (from + to);
}

}  // namespace bms::measurement
