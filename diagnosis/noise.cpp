#include "diagnosis/noise.hpp"

#include <algorithm>
#include <cmath>

namespace bms::diagnosis {

double price_of_noise(const NoiseModel& n, const NoiseModel& nominal) {
  const auto of = [](double ratio) { return ratio > 1 ? std::pow(std::log(ratio) / 0.15, 2) : 0; };
  return of(n.white_v / nominal.white_v) + of(n.fast_v / nominal.fast_v) + of(n.slow_v / nominal.slow_v) +
         of(n.edge / nominal.edge);
}

Whitener::Whitener(const NoiseModel& n, std::span<const double> time_s, const RowNoise& rows,
                   std::span<const char> usable)
    : gains_(time_s.size()) {
  double ff = n.fast_v * n.fast_v, ss = n.slow_v * n.slow_v, fs = 0;  // covariance of (fast, slow), stationary at first
  const double fast_v2 = ff, slow_v2 = ss;
  double last_s = -1, fast_left = 1, slow_left = 1;
  for (std::size_t k = 0; k < gains_.size(); ++k) {
    Gain& g = gains_[k];
    const double to_next_s = k + 1 < gains_.size() ? time_s[k + 1] - time_s[k] : 0;
    if (to_next_s != last_s) {  // steps are mostly equal
      last_s = to_next_s;
      fast_left = std::exp(-to_next_s / n.fast_s);
      slow_left = std::exp(-to_next_s / n.slow_s);
    }
    const double size = slow_v2 > 0 ? std::sqrt(1 + rows.slow_v2[k] / slow_v2) : 1;
    g = {0, 0, fast_left, slow_left, size, 0};
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
    ff = fast_v2 + g.fast_left * g.fast_left * (ff - fast_v2);
    ss = slow_v2 + g.slow_left * g.slow_left * (ss - slow_v2);
    fs *= g.fast_left * g.slow_left;
  }
}

void Whitener::whiten(Eigen::Ref<Columns> columns) const {
  if (columns.cols() == 1) {  // the residual itself, most often
    whiten(0, {columns.data(), gains_.size()});
    return;
  }
  Eigen::RowVectorXd fast = Eigen::RowVectorXd::Zero(columns.cols()), slow = fast, news = fast;
  for (std::size_t k = 0; k < gains_.size(); ++k) {
    const Gain& g = gains_[k];
    auto row = columns.row(static_cast<Eigen::Index>(k));
    if (g.weight > 0) {
      news = row - fast - g.slow_size * slow;
      fast = g.fast_left * (fast + g.fast * news);
      slow = g.slow_left * (slow + g.slow * news);
      row = g.weight * news;
    } else {
      fast *= g.fast_left;
      slow *= g.slow_left;
      row.setZero();
    }
  }
}

void Whitener::whiten(std::size_t first, std::span<double> values) const {
  double fast = 0, slow = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    const Gain& g = gains_[first + k];
    const double news = g.weight > 0 ? values[k] - fast - g.slow_size * slow : 0;
    fast = g.fast_left * (fast + g.fast * news);
    slow = g.slow_left * (slow + g.slow * news);
    values[k] = g.weight * news;
  }
}

double quantisation_step(std::span<const double> values) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < values.size(); ++k) {
    const double step = std::abs(values[k] - values[k - 1]);
    if (step > 1e-9) steps.push_back(step);
  }
  if (steps.size() < 20) return 0;
  const auto low = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 50);
  std::nth_element(steps.begin(), low, steps.end());
  // a converter's readings lie on a grid of its step; those of a reading that sticks until it leaps do not
  const double step = *low,
               zero = *std::find_if(values.begin(), values.end(), [](double v) { return std::isfinite(v); });
  std::size_t moved = 0, on_grid = 0;
  for (std::size_t k = 1; k < values.size(); ++k) {
    if (!(std::abs(values[k] - values[k - 1]) > 1e-9)) continue;
    const double at = (values[k] - zero) / step;
    ++moved;
    if (std::abs(at - std::round(at)) < 0.15) ++on_grid;
  }
  return on_grid * 5 > moved * 3 ? step : 0;
}

double white_noise(std::span<const double> v, std::span<const double> i, double quiet_a, double fallback_v) {
  std::vector<double> bends;
  for (std::size_t k = 2; k < v.size(); ++k) {
    const bool quiet = std::abs(i[k] - i[k - 1]) < quiet_a && std::abs(i[k - 1] - i[k - 2]) < quiet_a;
    const double bend = v[k] - 2 * v[k - 1] + v[k - 2];
    if (quiet && std::isfinite(bend)) bends.push_back(std::abs(bend));
  }
  if (bends.size() < 100) return fallback_v;
  const auto at = [&](double share) {
    const auto nth = bends.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(bends.size() - 1));
    std::nth_element(bends.begin(), nth, bends.end());
    return *nth;
  };
  // of a normal distribution's absolute values 50 % lie below 0.674 and 80 % below 1.282 sigma; second differences have
  // sqrt(6) sigma
  const double spread_v = std::max(at(0.5) / 0.6745, at(0.8) / 1.2816) / std::sqrt(6.0);
  return std::max({spread_v, quantisation_step(v) / std::sqrt(12.0), 5e-5});
}

}  // namespace bms::diagnosis
