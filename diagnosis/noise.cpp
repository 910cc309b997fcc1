#include "diagnosis/noise.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

double price_of_noise(const NoiseModel& n, const NoiseModel& nominal) {
  const auto price = [](double ratio) {
    return ratio > 1 ? std::pow(std::log(ratio) / thresholds.noise.amplitude_log_sigma, 2) : 0;
  };
  double sum = 0;
  for (const auto amplitude : amplitudes) sum += price(n.*amplitude / nominal.*amplitude);
  return sum;
}

Whitener::Whitener(const NoiseModel& n, std::span<const double> time_s, const RowNoise& rows,
                   std::span<const char> usable)
    : gains_(time_s.size()) {
  double ff = n.fast_v * n.fast_v, ss = n.slow_v * n.slow_v, fs = 0;  // covariance of (fast, slow), stationary at first
  const double fast_v2 = ff, slow_v2 = ss;
  double last_s = -1, fast_decay = 1, slow_decay = 1;
  for (std::size_t k = 0; k < gains_.size(); ++k) {
    Gain& g = gains_[k];
    const double to_next_s = k + 1 < gains_.size() ? time_s[k + 1] - time_s[k] : 0;
    if (to_next_s != last_s) {  // steps are mostly equal
      last_s = to_next_s;
      fast_decay = std::exp(-to_next_s / n.fast_s);
      slow_decay = std::exp(-to_next_s / n.slow_s);
    }
    const double size = slow_v2 > 0 ? std::sqrt(1 + rows.slow_v2[k] / slow_v2) : 1;
    g = {0, 0, fast_decay, slow_decay, size, 0};
    ff += n.edge * n.edge * rows.edge_v2[k];
    if (usable[k] != 0) {
      const double with_fast = ff + size * fs, with_slow = fs + size * ss;
      const double variance = with_fast + size * with_slow + n.white_v * n.white_v + n.edge * n.edge * rows.white_v2[k];
      g.fast = with_fast / variance;
      g.slow = with_slow / variance;
      g.weight = 1 / std::sqrt(variance);
      log_determinant_ += std::log(variance);
      ++used_;
      ff -= g.fast * with_fast;
      fs -= g.fast * with_slow;
      ss -= g.slow * with_slow;
    }
    ff = fast_v2 + g.fast_decay * g.fast_decay * (ff - fast_v2);
    ss = slow_v2 + g.slow_decay * g.slow_decay * (ss - slow_v2);
    fs *= g.fast_decay * g.slow_decay;
  }
}

void Whitener::whiten(Eigen::Ref<Columns> columns) const {
  if (columns.cols() == 1) {  // the residual itself, most often
    whiten(0, {columns.data(), gains_.size()});
    return;
  }
  Eigen::RowVectorXd fast = Eigen::RowVectorXd::Zero(columns.cols()), slow = fast, innovation = fast;
  for (std::size_t k = 0; k < gains_.size(); ++k) {
    const Gain& g = gains_[k];
    auto row = columns.row(static_cast<Eigen::Index>(k));
    if (g.weight > 0) {
      innovation = row - fast - g.slow_size * slow;
      fast = g.fast_decay * (fast + g.fast * innovation);
      slow = g.slow_decay * (slow + g.slow * innovation);
      row = g.weight * innovation;
    } else {
      fast *= g.fast_decay;
      slow *= g.slow_decay;
      row.setZero();
    }
  }
}

void Whitener::whiten(std::size_t first, std::span<double> values) const {
  double fast = 0, slow = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Gain& g = gains_[first + k];
    const double innovation = g.weight > 0 ? values[k] - fast - g.slow_size * slow : 0;
    fast = g.fast_decay * (fast + g.fast * innovation);
    slow = g.slow_decay * (slow + g.slow * innovation);
    values[k] = g.weight * innovation;
  }
}

double quantisation_step(std::span<const double> values) {
  constexpr const Thresholds::Quantisation& limits = thresholds.quantisation;
  std::vector<double> steps;
  for (std::size_t k = 1; k < values.size(); ++k) {
    const double step = std::abs(values[k] - values[k - 1]);
    if (step > numerics.noise.same_reading) steps.push_back(step);
  }
  if (steps.size() < limits.steps) return 0;
  const double step = measurement::quantile(steps, limits.step_quantile),
               zero = *std::find_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  // a converter's readings lie on a grid of its step; those of a reading that sticks until it leaps do not
  std::size_t moved = 0, on_grid = 0;
  for (std::size_t k = 1; k < values.size(); ++k) {
    if (!(std::abs(values[k] - values[k - 1]) > numerics.noise.same_reading)) continue;
    const double at = (values[k] - zero) / step;
    ++moved;
    if (std::abs(at - std::round(at)) < limits.grid_tolerance) ++on_grid;
  }
  return on_grid * limits.on_grid_of > moved * limits.on_grid ? step : 0;
}

double white_noise(std::span<const double> v, std::span<const double> i, double quiet_a, double fallback_v) {
  constexpr const Statistics& normal = numerics.statistics;
  std::vector<double> bends;
  for (std::size_t k = 2; k < v.size(); ++k) {
    const bool quiet = std::abs(i[k] - i[k - 1]) < quiet_a && std::abs(i[k - 1] - i[k - 2]) < quiet_a;
    const double bend = v[k] - 2 * v[k - 1] + v[k - 2];
    if (quiet && std::isfinite(bend)) bends.push_back(std::abs(bend));
  }
  if (bends.size() < thresholds.noise.second_differences) return fallback_v;
  const auto at = [&](double share) {
    const auto rank = static_cast<std::size_t>(share * static_cast<double>(bends.size() - 1));
    return measurement::order_statistic(bends, rank);
  };
  // two quantiles: with a coarse converter one of them may be 0
  const double spread_v =
      std::max(at(0.5) / normal.normal_abs_median, at(normal.quantile_80) / normal.normal_abs_quantile_80) /
      std::sqrt(normal.second_difference_variance);
  return std::max({spread_v, quantisation_step(v) / std::sqrt(normal.uniform_variance_denominator),
                   thresholds.noise.white_at_least_v});
}

}  // namespace bms::diagnosis
