// Consecutive rows, time steps and current steps of a recording. Each caller has its own thresholds.
#pragma once

#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

namespace bms::measurement {

/// Rows [begin, end).
struct Rows {
  std::size_t begin = 0, end = 0;
  std::size_t size() const { return end - begin; }
};

/// Where inside(row) is true for consecutive rows, of the rows 0 .. count - 1: each stretch as long as possible.
template <class Inside>
std::vector<Rows> consecutive_rows(std::size_t count, Inside&& inside) {
  std::vector<Rows> found;
  bool before = false;
  for (std::size_t k = 0; k < count; ++k) {
    const bool now = inside(k);
    if (now && !before) found.push_back({k, k});
    if (now) found.back().end = k + 1;
    before = now;
  }
  return found;
}

/// Times between neighbouring rows, one fewer than rows.
inline std::vector<double> time_steps(std::span<const double> time_s) {
  std::vector<double> steps_s;
  for (std::size_t k = 1; k < time_s.size(); ++k) steps_s.push_back(time_s[k] - time_s[k - 1]);
  return steps_s;
}

/// Rows that come more than limit_s after the row before.
inline std::vector<std::size_t> rows_after_gaps(std::span<const double> time_s, double limit_s) {
  std::vector<std::size_t> rows;
  for (std::size_t k = 1; k < time_s.size(); ++k) {
    if (time_s[k] - time_s[k - 1] > limit_s) rows.push_back(k);
  }
  return rows;
}

/// How the voltage moves with the current, over the rows in which the current steps.
struct StepCorrelation {
  double product = 0;  ///< sum of current step times voltage step
  double limit = 0;    ///< sqrt(sum of squared current steps times sum of squared voltage steps); |product| <= limit
  std::size_t steps = 0;
  std::size_t opposed = 0;  ///< steps in which the voltage moves against the current
};

/// Current steps of at least least_a count. A row next to a missing reading does not.
inline StepCorrelation step_correlation(std::span<const double> current_a, std::span<const double> voltage_v,
                                        double least_a) {
  StepCorrelation c;
  double current2 = 0, voltage2 = 0;
  for (std::size_t k = 1; k < voltage_v.size(); ++k) {
    const double di = current_a[k] - current_a[k - 1], dv = voltage_v[k] - voltage_v[k - 1];
    if (!std::isfinite(di) || !std::isfinite(dv) || std::abs(di) < least_a) continue;
    c.product += di * dv;
    current2 += di * di;
    voltage2 += dv * dv;
    ++c.steps;
    c.opposed += di * dv < 0 ? 1 : 0;
  }
  c.limit = std::sqrt(current2 * voltage2);
  return c;
}

}  // namespace bms::measurement
