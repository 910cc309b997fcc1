#include "diagnosis/noise.hpp"

#include <algorithm>
#include <cmath>

#include "arithmetic/vector_width.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"
#include "numerics/in_parallel.hpp"

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

/// Noise models next to each other, a lane each.
using Lanes = arithmetic::FourDoubles;
using arithmetic::doubles_at_once;

template <class Function>
void each_lane(double& x, const Function& f) {
  x = f(x);
}
template <class Function>
void each_lane(Lanes& x, const Function& f) {
  for (std::size_t lane = 0; lane < doubles_at_once; ++lane) x[lane] = f(x[lane]);
}

/// Squares of a noise model's amplitudes, or of several. Value: double or Lanes.
template <class Value>
struct Squares {
  Value white_v2, fast_v2, slow_v2, edge2;
};

Squares<double> squares_of(const NoiseModel& n) {
  return {n.white_v * n.white_v, n.fast_v * n.fast_v, n.slow_v * n.slow_v, n.edge * n.edge};
}

/// The Kalman filter of the fast and the slow part, as far as it does not depend on the residual: gains row by row.
template <class Value>
class NoiseFilter {
 public:
  /// times: only the correlation times count.
  NoiseFilter(const Squares<Value>& squares, const NoiseModel& times, std::span<const double> time_s,
              const RowNoise& rows, std::span<const char> usable)
      : of_(squares), times_(times), time_s_(time_s), rows_(rows), usable_(usable) {}

  struct Gain {
    Value fast, slow;               ///< Kalman gain of each state
    double fast_decay, slow_decay;  ///< of each state until the next row
    Value slow_size;                ///< standard deviation of the slow part over that on a flat OCV
    Value variance;                 ///< of the innovation, if the row is used
    bool used;
  };
  /// Of row k; the rows must be taken in turn.
  Gain next(std::size_t k) {
    const double to_next_s = k + 1 < time_s_.size() ? time_s_[k + 1] - time_s_[k] : 0;
    if (to_next_s != last_s_) {  // steps are mostly equal
      last_s_ = to_next_s;
      fast_decay_ = std::exp(-to_next_s / times_.fast_s);
      slow_decay_ = std::exp(-to_next_s / times_.slow_s);
    }
    Value size = 1 + (of_.slow_v2 > Value{} ? rows_.slow_v2[k] / of_.slow_v2 : Value{});
    each_lane(size, [](double x) { return std::sqrt(x); });
    Gain g{Value{}, Value{}, fast_decay_, slow_decay_, size, Value{}, usable_[k] != 0};
    ff_ += of_.edge2 * rows_.edge_v2[k];
    if (g.used) {
      const Value with_fast = ff_ + size * fs_, with_slow = fs_ + size * ss_;
      g.variance = with_fast + size * with_slow + of_.white_v2 + of_.edge2 * rows_.white_v2[k];
      const Value information = 1 / g.variance;
      g.fast = with_fast * information;
      g.slow = with_slow * information;
      ff_ -= g.fast * with_fast;
      fs_ -= g.fast * with_slow;
      ss_ -= g.slow * with_slow;
    }
    ff_ = of_.fast_v2 + fast_decay_ * fast_decay_ * (ff_ - of_.fast_v2);
    ss_ = of_.slow_v2 + slow_decay_ * slow_decay_ * (ss_ - of_.slow_v2);
    fs_ *= fast_decay_ * slow_decay_;
    return g;
  }

 private:
  Squares<Value> of_;
  const NoiseModel& times_;
  std::span<const double> time_s_;
  const RowNoise& rows_;
  std::span<const char> usable_;
  Value ff_ = of_.fast_v2, ss_ = of_.slow_v2, fs_{};  ///< covariance of (fast, slow), stationary at first
  double last_s_ = -1, fast_decay_ = 1, slow_decay_ = 1;
};

/// Sum of logarithms: of products as long as a double holds them, because a logarithm costs as much as a row.
template <class Value>
class SumOfLogarithms {
 public:
  void add(const Value& x) {
    product_ *= x;
    if (++factors_ == numerics.noise.factors) flush();
  }
  void add_to(Value& sum) {
    flush();
    sum += sum_;
  }

 private:
  void flush() {
    each_lane(product_, [](double x) { return std::log(x); });
    sum_ += product_;
    product_ = one;
    factors_ = 0;
  }
  static constexpr Value one = Value{} + 1;
  Value sum_{}, product_ = one;
  int factors_ = 0;
};

/// -2 log likelihoods of some noise models, a lane each.
void add_costs(const Squares<Lanes>& squares, const NoiseModel& times, std::span<const double> time_s,
               const RowNoise& rows, std::span<const char> usable, std::span<const double> residual_v, Lanes& sum) {
  NoiseFilter<Lanes> filter(squares, times, time_s, rows, usable);
  SumOfLogarithms<Lanes> log_determinant;
  Lanes fast{}, slow{};
  for (std::size_t k = 0; k < time_s.size(); ++k) {
    const NoiseFilter<Lanes>::Gain g = filter.next(k);
    const Lanes innovation = g.used ? residual_v[k] - fast - g.slow_size * slow : Lanes{};
    fast = g.fast_decay * (fast + g.fast * innovation);
    slow = g.slow_decay * (slow + g.slow * innovation);
    if (!g.used) continue;
    sum += innovation * innovation / g.variance;
    log_determinant.add(g.variance);
  }
  log_determinant.add_to(sum);
}

}  // namespace

Whitener::Whitener(const NoiseModel& n, std::span<const double> time_s, const RowNoise& rows,
                   std::span<const char> usable)
    : gains_(time_s.size()) {
  NoiseFilter<double> filter(squares_of(n), n, time_s, rows, usable);
  SumOfLogarithms<double> log_determinant;
  for (std::size_t k = 0; k < gains_.size(); ++k) {
    const NoiseFilter<double>::Gain g = filter.next(k);
    gains_[k] = {g.fast, g.slow, g.fast_decay, g.slow_decay, g.slow_size, g.used ? 1 / std::sqrt(g.variance) : 0};
    if (!g.used) continue;
    log_determinant.add(g.variance);
    ++used_;
  }
  log_determinant.add_to(log_determinant_);
}

std::vector<double> minus_two_log_likelihoods(std::span<const NoiseModel> noises, std::span<const double> time_s,
                                              const RowNoise& rows, std::span<const char> usable,
                                              std::span<const double> residual_v) {
  std::vector<double> sums;
  for (std::size_t first = 0; first < noises.size(); first += doubles_at_once) {
    Squares<Lanes> squares{};
    for (std::size_t lane = 0; lane < doubles_at_once; ++lane) {
      const Squares<double> one = squares_of(noises[std::min(first + lane, noises.size() - 1)]);
      squares.white_v2[lane] = one.white_v2;
      squares.fast_v2[lane] = one.fast_v2;
      squares.slow_v2[lane] = one.slow_v2;
      squares.edge2[lane] = one.edge2;
    }
    Lanes of{};
    arithmetic::in_widest_vectors([&] { add_costs(squares, noises[first], time_s, rows, usable, residual_v, of); });
    for (std::size_t lane = 0; lane < doubles_at_once && first + lane < noises.size(); ++lane) sums.push_back(of[lane]);
  }
  return sums;
}

void Whitener::whiten(Eigen::Ref<Columns> columns) const {
  if (columns.cols() == 1) {  // the residual itself, most often
    whiten(0, {columns.data(), gains_.size()});
    return;
  }
  // whole registers to each piece: their results do not depend on it
  const auto count = static_cast<std::size_t>(columns.cols()),
             registers = (count + doubles_at_once - 1) / doubles_at_once;
  const bool large = static_cast<double>(columns.size()) > numerics.products.worth_a_thread;
  const std::size_t pieces = large ? std::min(numerics::best_pieces(), registers) : 1;
  numerics::in_parallel(pieces, [&](std::size_t k) {
    const std::size_t first = k * registers / pieces * doubles_at_once,
                      end = std::min(count, (k + 1) * registers / pieces * doubles_at_once);
    whiten_some(columns.data() + first, end - first, columns.outerStride());
  });
}

void Whitener::whiten_some(double* columns, std::size_t count, Eigen::Index stride) const {
  std::vector<double> fast(count), slow(count);
  arithmetic::in_widest_vectors([&] {
    for (std::size_t k = 0; k < gains_.size(); ++k) {
      const Gain& g = gains_[k];
      double* row = columns + static_cast<Eigen::Index>(k) * stride;
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
