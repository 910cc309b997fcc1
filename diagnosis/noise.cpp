#include "diagnosis/noise.hpp"

#include <algorithm>
#include <cmath>

#include "arithmetic/vector_width.hpp"
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

namespace {

/// The Kalman filter of the fast and the slow part, as far as it does not depend on the residual: gains row by row.
class NoiseFilter {
 public:
  NoiseFilter(const NoiseModel& n, std::span<const double> time_s, const RowNoise& rows, std::span<const char> usable)
      : n_(n),
        time_s_(time_s),
        rows_(rows),
        usable_(usable),
        white_v2_(n.white_v * n.white_v),
        edge2_(n.edge * n.edge) {}

  struct Gain {
    double fast, slow;              ///< Kalman gain of each state
    double fast_decay, slow_decay;  ///< of each state until the next row
    double slow_size;               ///< standard deviation of the slow part over that on a flat OCV
    double variance;                ///< of the innovation; 0: row not used
  };
  /// Of row k; the rows must be taken in turn.
  Gain next(std::size_t k) {
    const double to_next_s = k + 1 < time_s_.size() ? time_s_[k + 1] - time_s_[k] : 0;
    if (to_next_s != last_s_) {  // steps are mostly equal
      last_s_ = to_next_s;
      fast_decay_ = std::exp(-to_next_s / n_.fast_s);
      slow_decay_ = std::exp(-to_next_s / n_.slow_s);
    }
    const double size = slow_v2_ > 0 ? std::sqrt(1 + rows_.slow_v2[k] / slow_v2_) : 1;
    Gain g{0, 0, fast_decay_, slow_decay_, size, 0};
    ff_ += edge2_ * rows_.edge_v2[k];
    if (usable_[k] != 0) {
      const double with_fast = ff_ + size * fs_, with_slow = fs_ + size * ss_;
      g.variance = with_fast + size * with_slow + white_v2_ + edge2_ * rows_.white_v2[k];
      const double information = 1 / g.variance;
      g.fast = with_fast * information;
      g.slow = with_slow * information;
      ff_ -= g.fast * with_fast;
      fs_ -= g.fast * with_slow;
      ss_ -= g.slow * with_slow;
    }
    ff_ = fast_v2_ + fast_decay_ * fast_decay_ * (ff_ - fast_v2_);
    ss_ = slow_v2_ + slow_decay_ * slow_decay_ * (ss_ - slow_v2_);
    fs_ *= fast_decay_ * slow_decay_;
    return g;
  }

 private:
  const NoiseModel& n_;
  std::span<const double> time_s_;
  const RowNoise& rows_;
  std::span<const char> usable_;
  double white_v2_, edge2_;
  double fast_v2_ = n_.fast_v * n_.fast_v, slow_v2_ = n_.slow_v * n_.slow_v;
  double ff_ = fast_v2_, ss_ = slow_v2_, fs_ = 0;  ///< covariance of (fast, slow), stationary at first
  double last_s_ = -1, fast_decay_ = 1, slow_decay_ = 1;
};

/// Sum of logarithms: of products as long as a double holds them, because a logarithm costs as much as a row.
class SumOfLogarithms {
 public:
  void add(double x) {
    product_ *= x;
    if (++factors_ == numerics.noise.factors) flush();
  }
  double value() {
    flush();
    return sum_;
  }

 private:
  void flush() {
    sum_ += std::log(product_);
    product_ = 1;
    factors_ = 0;
  }
  double sum_ = 0, product_ = 1;
  int factors_ = 0;
};

}  // namespace

Whitener::Whitener(const NoiseModel& n, std::span<const double> time_s, const RowNoise& rows,
                   std::span<const char> usable)
    : gains_(time_s.size()) {
  NoiseFilter filter(n, time_s, rows, usable);
  SumOfLogarithms log_determinant;
  for (std::size_t k = 0; k < gains_.size(); ++k) {
    const NoiseFilter::Gain g = filter.next(k);
    const bool used = g.variance > 0;
    gains_[k] = {g.fast, g.slow, g.fast_decay, g.slow_decay, g.slow_size, used ? 1 / std::sqrt(g.variance) : 0};
    if (!used) continue;
    log_determinant.add(g.variance);
    ++used_;
  }
  log_determinant_ = log_determinant.value();
}

double minus_two_log_likelihood(const NoiseModel& n, std::span<const double> time_s, const RowNoise& rows,
                                std::span<const char> usable, std::span<const double> residual_v) {
  NoiseFilter filter(n, time_s, rows, usable);
  SumOfLogarithms log_determinant;
  double fast = 0, slow = 0, squares = 0;
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    const NoiseFilter::Gain g = filter.next(k);
    const double innovation = g.variance > 0 ? residual_v[k] - fast - g.slow_size * slow : 0;
    fast = g.fast_decay * (fast + g.fast * innovation);
    slow = g.slow_decay * (slow + g.slow * innovation);
    if (!(g.variance > 0)) continue;
    squares += innovation * innovation / g.variance;
    log_determinant.add(g.variance);
  }
  return squares + log_determinant.value();
}

void Whitener::whiten(Eigen::Ref<Columns> columns) const {
  if (columns.cols() == 1) {  // the residual itself, most often
    whiten(0, {columns.data(), gains_.size()});
    return;
  }
  const auto count = static_cast<std::size_t>(columns.cols());
  std::vector<double> fast(count), slow(count);
  arithmetic::in_widest_vectors([&] {
    for (std::size_t k = 0; k < gains_.size(); ++k) {
      const Gain& g = gains_[k];
      double* row = columns.data() + static_cast<Eigen::Index>(k) * columns.outerStride();
      arithmetic::each_register(count, [&]<class Value>(std::size_t at) {
        arithmetic::Loaded<Value> x(row + at), f(fast.data() + at), s(slow.data() + at);
        if (g.weight > 0) {
          const Value innovation = x.value - f.value - g.slow_size * s.value;
          f.value = g.fast_decay * (f.value + g.fast * innovation);
          s.value = g.slow_decay * (s.value + g.slow * innovation);
          x.value = g.weight * innovation;
        } else {
          f.value *= g.fast_decay;
          s.value *= g.slow_decay;
          x.value = Value{};
        }
        x.store(row + at);
        f.store(fast.data() + at);
        s.store(slow.data() + at);
      });
    }
  });
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
