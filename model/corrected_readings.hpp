// The readings of a recording with two faults undone that need the readings around them: a delayed current and a
// temperature that lags.
//
//   current      Whole steps of the delay: the mean of the current over (t[k - 1] + delay, t[k] + delay], from the
//                charge by linear interpolation; before the first row and after the last the current continues.
//                The rest, a part p of a step: a late reading contains (1 - p) of the current of its own interval and p
//                of the one before; an early one p of the one after. This is solved row by row. (Reading between the
//                rows instead would smear an edge twice.)
//   temperature  T + lag dT/dt, dT/dt the least-squares slope over half a minute to either side
//
// A missing current (NaN) is replaced by the last known one, 0 at first; a missing temperature by the last known one,
// assumed_ambient_c at first. Laws undo offset, gain and clipping, one reading at a time (model/extended.hpp).
//
// S: double or a dual number, for derivatives by the delay and the lag. Host only: it copies the columns.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <vector>

#include "arithmetic/exponential.hpp"
#include "model/temperature.hpp"

namespace bms::model {

using namespace arithmetic;  // the physics uses these number types and functions

template <class S>
class CorrectedReadings {
 public:
  /// Columns of equal length, time ascending; temperature_c may be empty. time_s must outlive this.
  CorrectedReadings(std::span<const double> time_s, std::span<const double> current_a,
                    std::span<const double> temperature_c, S delay_s, S lag_s)
      : time_s_(time_s),
        current_a_(known(current_a, 0)),
        delay_s_(delay_s),
        lag_s_(lag_s),
        late_(acts(delay_s)),
        lagging_(acts(lag_s)) {
    temperature_c_ = temperature_c.empty() ? std::vector<double>(time_s.size(), assumed_ambient_c)
                                           : known(temperature_c, assumed_ambient_c);
    if (late_) undo_delay();
    if (lagging_) slopes();
  }

  /// Current in the interval that ends at row k. For the first row, and for a row that is not later than the one
  /// before, the current at that moment.
  S current(std::size_t k) const { return late_ ? true_a_[k] : S(current_a_[k]); }

  S temperature(std::size_t k) const {
    if (!lagging_) return S(temperature_c_[k]);
    return S(lag_s_ * c_per_s_[k] + temperature_c_[k]);
  }

 private:
  static constexpr double half_window_s = 30;
  static constexpr double most_part = 0.45;  ///< of a step; at half a step the two rows cannot be separated

  static double value(const S& s) {
    if constexpr (Dual<S>)
      return s.a;
    else
      return s;
  }
  static S with_value(S s, double v) {
    if constexpr (Dual<S>)
      s.a = v;
    else
      s = v;
    return s;
  }
  /// Returns true if there is a fault to undo, or a derivative to compute.
  static bool acts(const S& s) {
    if constexpr (Dual<S>)
      return s.a != 0 || s.v != S(0).v;
    else
      return s != 0;
  }
  static std::vector<double> known(std::span<const double> column, double at_first) {
    std::vector<double> all(column.begin(), column.end());
    double last = at_first;
    for (double& v : all) {
      if (v == v)
        last = v;
      else
        v = last;
    }
    return all;
  }

  /// Length of most steps.
  double usual_step_s() const {
    std::vector<double> steps;
    for (std::size_t k = 1; k < time_s_.size(); ++k) steps.push_back(time_s_[k] - time_s_[k - 1]);
    if (steps.empty()) return 1;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    return *middle > 0 ? *middle : 1;
  }

  void undo_delay() {
    const std::size_t rows = time_s_.size();
    const double step_s = usual_step_s(), whole_s = std::round(value(delay_s_) / step_s) * step_s;
    const std::vector<double> moved_a = moved_by(whole_s);
    const S rest_s = delay_s_ - whole_s;
    const auto duration_s = [&](std::size_t k) { return k == 0 ? 0 : time_s_[k] - time_s_[k - 1]; };
    const auto part = [&](std::size_t k) {
      const S p = S(rest_s / duration_s(k));
      if (value(p) > most_part) return S(most_part);
      return value(p) < -most_part ? S(-most_part) : p;
    };
    true_a_.clear();
    for (const double a : moved_a) true_a_.push_back(S(a));
    if (value(rest_s) > 0) {
      for (std::size_t k = 1; k < rows; ++k) {
        if (!(duration_s(k) > 0)) continue;
        const S p = part(k);
        true_a_[k] = S((moved_a[k] - p * true_a_[k - 1]) / (1.0 - p));
      }
    } else if (value(rest_s) < 0) {
      for (std::size_t k = rows - 1; k-- > 1;) {
        if (!(duration_s(k) > 0)) continue;
        const S p = -part(k);
        true_a_[k] = S((moved_a[k] - p * true_a_[k + 1]) / (1.0 - p));
      }
    } else {
      // whole steps only: the values stay the same; the derivative is the mean of both sides
      for (std::size_t k = 1; k + 1 < rows; ++k) {
        if (duration_s(k) > 0)
          true_a_[k] = with_value(S(part(k) * ((moved_a[k + 1] - moved_a[k - 1]) / 2)), moved_a[k]);
      }
    }
  }

  /// Row whose interval contains the time; the search starts at row `near`. The last row for later times.
  std::size_t row_at(double time_s, std::size_t near) const {
    std::size_t j = near;
    while (j + 1 < time_s_.size() && time_s_[j] < time_s) ++j;
    while (j > 0 && time_s_[j - 1] >= time_s) --j;
    return j;
  }

  /// Mean current over each row's interval, shifted by delay_s.
  std::vector<double> moved_by(double delay_s) const {
    if (delay_s == 0) return current_a_;
    std::vector<double> charge_as(time_s_.size(), 0), moved_a = current_a_;
    for (std::size_t k = 1; k < time_s_.size(); ++k)
      charge_as[k] = charge_as[k - 1] + current_a_[k] * (time_s_[k] - time_s_[k - 1]);
    const auto charge_by = [&](std::size_t k) {
      const double moved_s = time_s_[k] + delay_s;
      const std::size_t j = row_at(moved_s, k);
      return charge_as[j] + current_a_[j] * (moved_s - time_s_[j]);
    };
    for (std::size_t k = 0; k < time_s_.size(); ++k) {
      const double duration_s = k == 0 ? 0 : time_s_[k] - time_s_[k - 1];
      moved_a[k] =
          duration_s > 0 ? (charge_by(k) - charge_by(k - 1)) / duration_s : current_a_[row_at(time_s_[k] + delay_s, k)];
    }
    return moved_a;
  }

  /// Sums over a moving window: each row enters once and leaves once. The window contains at least the neighbours.
  void slopes() {
    const std::size_t rows = time_s_.size();
    c_per_s_.assign(rows, 0);
    if (rows < 2) return;
    double n = 0, t = 0, tt = 0, c = 0, tc = 0;
    const auto take = [&](std::size_t k, double sign) {
      const double s = time_s_[k] - time_s_[0], warm = temperature_c_[k] - temperature_c_[0];
      n += sign;
      t += sign * s;
      tt += sign * s * s;
      c += sign * warm;
      tc += sign * s * warm;
    };
    std::size_t from = 0, to = 0;  // rows in the sums: from .. to - 1
    for (std::size_t k = 0; k < rows; ++k) {
      while (to < rows && (time_s_[to] <= time_s_[k] + half_window_s || to <= k + 1)) take(to++, 1);
      while (from + 1 < k && time_s_[from] < time_s_[k] - half_window_s) take(from++, -1);
      const double spread = n * tt - t * t;
      c_per_s_[k] = spread > 1e-9 * n * n ? (n * tc - t * c) / spread : 0;
    }
  }

  std::span<const double> time_s_;
  std::vector<double> current_a_, temperature_c_, c_per_s_;
  std::vector<S> true_a_;
  S delay_s_, lag_s_;
  bool late_, lagging_;
};

}  // namespace bms::model
