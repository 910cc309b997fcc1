#include "measurement/soc_column.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace bms::measurement {

namespace {

constexpr std::size_t fewest_values = 20, fewest_steps = 6;
constexpr double limit = 0.02;           ///< of a change that no charge explains
constexpr double least_step = 0.005;     ///< of an increment
constexpr double at_the_end = 0.005;     ///< a column that is full or empty stays there
constexpr double together_s = 120;       ///< a correction may take so long
constexpr double most_before = 50;       ///< a jump begins where at least this part of it is
constexpr double least_capacity = 0.05;  ///< relative difference
constexpr double block_charge = 0.02;    ///< smallest part of the log whose change and charge are compared
constexpr double mad_to_sigma = 1.4826, sigmas = 6;

/// One value of the column and what happened since the value before.
struct Value {
  double time_s = 0, soc = 0, change = 0;
  double charge = 0;     ///< since the value before, as a fraction of the capacity; 0 where the column is at its end
  double unknown = 0;    ///< of it, because the current within a row is not known
  double voltage_v = 0;  ///< change
};

double median(std::vector<double> list) {
  if (list.empty()) return 0;
  const auto middle = list.begin() + static_cast<std::ptrdiff_t>(list.size() / 2);
  std::nth_element(list.begin(), middle, list.end());
  return *middle;
}

/// Without a current for longer than this, what was charged meanwhile is not known: a minute, or ten usual rows [s].
double longest_gap_s(const Recording& r) {
  std::vector<double> rows_s;
  for (std::size_t k = 1; k < r.rows(); ++k) rows_s.push_back(r.time_s[k] - r.time_s[k - 1]);
  return std::max(60.0, 10 * median(std::move(rows_s)));
}

std::vector<Value> values_of(const Recording& r, double capacity_ah) {
  const double gap_s = longest_gap_s(r);
  double without_s = 0;
  bool lost = false;
  std::vector<Value> values;
  double charge = 0, unknown = 0, current_a = 0, voltage_v = std::numeric_limits<double>::quiet_NaN();
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const double hours = k == 0 ? 0 : (r.time_s[k] - r.time_s[k - 1]) / 3'600;
    const bool known = !std::isnan(r.current_a[k]);
    const double now_a = known ? r.current_a[k] : current_a;
    without_s += 3'600 * hours;
    lost = lost || without_s > gap_s;
    if (known) without_s = 0;
    charge += (now_a + current_a) / 2 * hours / capacity_ah;
    unknown += std::abs(now_a - current_a) / 2 * hours / capacity_ah;
    current_a = now_a;
    if (std::isnan(r.soc_ref[k])) continue;
    Value v{.time_s = r.time_s[k], .soc = r.soc_ref[k]};
    if (!values.empty()) {
      v.change = v.soc - values.back().soc;
      v.charge = charge;
      v.unknown = unknown;
      const bool full = v.soc >= 1 - at_the_end && charge > 0, empty = v.soc <= at_the_end && charge < 0;
      const bool at_end = full || empty;  // and the charge goes on
      if (at_end && std::abs(v.change) < std::abs(charge)) v.charge = v.change;
    }
    if (k < r.voltage_v.size() && !std::isnan(r.voltage_v[k])) {
      v.voltage_v = std::isnan(voltage_v) ? 0 : r.voltage_v[k] - voltage_v;
      voltage_v = r.voltage_v[k];
    }
    if (lost) v.change = v.charge = v.unknown = v.voltage_v = 0;  // not judged
    values.push_back(v);
    charge = unknown = 0;
    lost = false;
  }
  return values;
}

/// The coarsest grid on which all values lie, up to quarters; 0: finer than 0.01 %.
double grid_of(const std::vector<Value>& values) {
  constexpr std::array steps = {0.25, 0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 1e-4};
  for (const double step : steps) {
    const bool on_it = std::all_of(values.begin(), values.end(), [step](const Value& v) {
      return std::abs(v.soc / step - std::round(v.soc / step)) < 1e-3;
    });
    if (on_it) return step;
  }
  return 0;
}

/// The step of the column: nine of ten of its changes are not larger, and the smallest.
struct Resolution {
  double usual = 0, smallest = 0;
};
Resolution resolution_of(const std::vector<Value>& values) {
  std::vector<double> changes;
  for (const Value& v : values) {
    if (std::abs(v.change) > 1e-9) changes.push_back(std::abs(v.change));
  }
  if (changes.empty()) return {};            // a column that does not move has no step
  constexpr std::size_t fewest_changes = 3;  // fewer may each be a jump: then the values themselves say the step
  if (changes.size() < fewest_changes) return {grid_of(values), grid_of(values)};
  std::sort(changes.begin(), changes.end());
  const std::size_t at = changes.size() < fewest_values ? changes.size() / 2 : changes.size() * 9 / 10;
  return {changes[at], changes.front()};
}

/// Least squares of y over up to three columns; the coefficients and the RMS of the rest.
template <std::size_t N>
struct Fit {
  std::array<double, N> coefficient{};
  double rms = 0;
};
template <std::size_t N>
Fit<N> fit(const std::vector<std::array<double, N>>& rows, const std::vector<double>& y) {
  std::array<std::array<double, N + 1>, N> m{};
  for (std::size_t k = 0; k < y.size(); ++k) {
    for (std::size_t i = 0; i < N; ++i) {
      for (std::size_t j = 0; j < N; ++j) m[i][j] += rows[k][i] * rows[k][j];
      m[i][N] += rows[k][i] * y[k];
    }
  }
  for (std::size_t i = 0; i < N; ++i) {
    m[i][i] += 1e-12;
    for (std::size_t below = i + 1; below < N; ++below) {
      const double factor = m[below][i] / m[i][i];
      for (std::size_t j = i; j <= N; ++j) m[below][j] -= factor * m[i][j];
    }
  }
  Fit<N> result;
  for (std::size_t i = N; i-- > 0;) {
    double sum = m[i][N];
    for (std::size_t j = i + 1; j < N; ++j) sum -= m[i][j] * result.coefficient[j];
    result.coefficient[i] = sum / m[i][i];
  }
  for (std::size_t k = 0; k < y.size(); ++k) {
    double rest = y[k];
    for (std::size_t i = 0; i < N; ++i) rest -= result.coefficient[i] * rows[k][i];
    result.rms += rest * rest / static_cast<double>(y.size());
  }
  result.rms = std::sqrt(result.rms);
  return result;
}

class Judge {
 public:
  Judge(const Recording& r, double capacity_ah) : capacity_ah_(capacity_ah), values_(values_of(r, capacity_ah)) {}

  SocColumn judge() {
    SocColumn column;
    if (values_.size() < fewest_values) return column;
    step_ = resolution_of(values_);
    column.resolution = step_.usual >= 1e-4 ? step_.usual : 0;
    const double by_blocks = ratio_of_blocks();
    if (!find_table(by_blocks)) {
      find_unmoved();
      find_jumps(by_blocks);
      const double ratio = find_slopes(false);
      if (ratio != by_blocks) {
        std::erase_if(events_, [](const SocEvent& e) { return e.fault != SocFault::stuck; });
        find_jumps(ratio);
      }
      find_slopes(true);
    }
    std::stable_sort(events_.begin(), events_.end(),
                     [](const SocEvent& a, const SocEvent& b) { return a.time_s < b.time_s; });
    column.events = std::move(events_);
    column.is_count = column.events.empty();
    return column;
  }

 private:
  double noise(double ratio) const {
    std::vector<double> rest;
    for (const Value& v : values_) rest.push_back(std::abs(v.change - ratio * v.charge));
    return mad_to_sigma * median(std::move(rest));
  }

  /// Median over parts of the log of change / charge, by charge: a jump or a stretch that does not move is in few of
  /// them. 1 where it is nearly that, or where there are few parts: the current counts with the capacity.
  double ratio_of_blocks() const {
    constexpr std::size_t fewest_blocks = 8;
    std::vector<std::pair<double, double>> blocks;  // ratio, weight
    double change = 0, charge = 0, unknown = 0, total = 0;
    for (const Value& v : values_) {
      change += v.change;
      charge += v.charge;
      unknown += v.unknown;
      if (std::abs(charge) < block_charge + 4 * step_.usual + unknown) continue;
      blocks.emplace_back(change / charge, std::abs(charge));
      total += std::abs(charge);
      change = charge = unknown = 0;
    }
    if (blocks.size() < fewest_blocks) return 1;
    std::sort(blocks.begin(), blocks.end());
    double below = 0;
    for (const auto& [ratio, weight] : blocks) {
      below += weight;
      if (below < total / 2) continue;
      return std::abs(ratio - 1) > least_capacity && ratio > 0 ? ratio : 1;
    }
    return 1;
  }

  /// Many increments that no charge explains have the sign of the voltage's: a table.
  bool find_table(double ratio) {
    std::size_t steps = 0, alike = 0;
    double largest = 0, first_s = values_.front().time_s;
    for (const Value& v : values_) {
      const double rest = v.change - ratio * v.charge;
      if (std::abs(rest) < 1.05 * step_.smallest + least_step + v.unknown || std::abs(v.voltage_v) < 1e-4) continue;
      if (steps++ == 0) first_s = v.time_s;
      alike += rest * v.voltage_v > 0 ? 1 : 0;
      largest = std::max(largest, std::abs(rest));
    }
    constexpr double most_others = 0.15;
    if (steps < fewest_steps || static_cast<double>(steps - alike) > most_others * static_cast<double>(steps))
      return false;
    events_.push_back({first_s, SocFault::table, largest});
    return true;
  }

  /// Stretches in which the column does not move while charge flows.
  void find_unmoved() {
    unmoved_.assign(values_.size(), false);
    for (std::size_t k = 1; k < values_.size();) {
      double charge = 0, unknown = 0, largest = 0;
      std::size_t end = k;
      for (; end < values_.size() && std::abs(values_[end].change) < 1e-9; ++end) {
        charge += values_[end].charge;
        unknown += values_[end].unknown * values_[end].unknown;
        largest = std::max(largest, std::abs(charge));
      }
      if (largest > limit + 2 * step_.usual + 3 * std::sqrt(unknown)) {
        events_.push_back({values_[k - 1].time_s, SocFault::stuck, largest});
        std::fill(unmoved_.begin() + static_cast<std::ptrdiff_t>(k),
                  unmoved_.begin() + static_cast<std::ptrdiff_t>(std::min(end + 1, values_.size())), true);
      }
      k = end + 1;
    }
  }

  /// Increments that the charge does not explain, alone or within two minutes.
  void find_jumps(double ratio) {
    jump_.assign(values_.size(), 0);
    const double noise_now = sigmas * noise(ratio);
    const double least = limit + 1.05 * step_.usual + noise_now;  // of a jump
    for (std::size_t k = 1; k < values_.size(); ++k) {
      const double here = values_[k].change - ratio * values_[k].charge;
      if (unmoved_[k] || std::abs(here) < least / most_before) continue;
      double sum = 0, unknown = 0, largest = 0;
      std::size_t end = k, at = k;
      std::size_t best_end = k;
      double best = 0;
      for (; end < values_.size() && !unmoved_[end] &&
             (end == k || values_[end].time_s - values_[k].time_s <= together_s);
           ++end) {
        const double rest = values_[end].change - ratio * values_[end].charge;
        sum += rest;
        unknown += values_[end].unknown;
        if (std::abs(rest) > largest) {
          largest = std::abs(rest);
          at = end;
        }
        const double beyond = std::abs(sum) - (least + unknown);
        if (std::abs(rest) > least_step + noise_now / 2 && beyond > 0 && std::abs(sum) > std::abs(best)) {
          best = sum;
          best_end = end;
        }
      }
      if (best == 0 || std::abs(here) < std::abs(best) / most_before) continue;
      for (std::size_t j = k; j <= best_end; ++j) jump_[j] = values_[j].change - ratio * values_[j].charge;
      const bool full = best > 0 && values_[best_end].soc >= 1 - at_the_end;
      events_.push_back({values_[at].time_s, full ? SocFault::reset : SocFault::jump, best});
      k = best_end;
    }
  }

  /// The column without its jumps against charge and time. Returns the ratio of the cell's capacity to that which the
  /// column counts with; adds an event if `name` is set.
  double find_slopes(bool name) {
    std::vector<double> y, charge, time;
    double soc = 0, sum = 0, unknown = 0;
    for (std::size_t k = 0; k < values_.size(); ++k) {
      if (!unmoved_[k]) {
        soc += values_[k].change - jump_[k];
        sum += jump_[k] == 0 ? values_[k].charge : 0;
        unknown += values_[k].unknown * values_[k].unknown;
      }
      y.push_back(soc - sum);
      charge.push_back(sum);
      time.push_back(values_[k].time_s - values_.front().time_s);
    }
    const double span_s = std::max(1.0, time.back());
    for (double& t : time) t /= span_s;
    const auto one = [&](const std::vector<double>& x) {
      std::vector<std::array<double, 2>> rows;
      for (const double v : x) rows.push_back({1, v});
      return fit<2>(rows, y);
    };
    const auto [low, high] = std::minmax_element(charge.begin(), charge.end());
    const double range = *high - *low, least = limit + 1.5 * step_.usual + 3 * std::sqrt(unknown);
    const auto by_charge = one(charge), by_time = one(time);
    auto late = by_time;
    double onset = 0;
    constexpr int onsets = 40;
    for (int k = 1; k < onsets; ++k) {
      const double begin = k / static_cast<double>(onsets);
      std::vector<double> x;
      for (const double t : time) x.push_back(std::max(0.0, t - begin));
      const auto tried = one(x);
      if (tried.rms >= late.rms) continue;
      late = tried;
      onset = begin;
    }
    constexpr double clearly = 0.7;
    if (late.rms > clearly * by_time.rms) {
      late = by_time;
      onset = 0;
    }
    const double drift = late.coefficient[1] * (1 - onset), ratio = 1 + by_charge.coefficient[1];
    const bool capacity = std::abs(ratio - 1) > least_capacity && std::abs(ratio - 1) * range > least && ratio > 0;
    const bool drifts = std::abs(drift) > least;
    if (capacity && (!drifts || by_charge.rms <= late.rms)) {
      if (name) events_.push_back({values_.front().time_s, SocFault::capacity, capacity_ah_ / ratio});
      return ratio;
    }
    if (drifts && name) events_.push_back({values_.front().time_s + onset * span_s, SocFault::drift, drift});
    return 1;
  }

  double capacity_ah_;
  std::vector<Value> values_;
  Resolution step_;
  std::vector<bool> unmoved_;
  std::vector<double> jump_;  ///< of the column, in the values where no charge explains it
  std::vector<SocEvent> events_;
};

}  // namespace

bool SocColumn::contradicts() const {
  return std::any_of(events.begin(), events.end(),
                     [](const SocEvent& e) { return e.fault != SocFault::drift && e.fault != SocFault::capacity; });
}

SocColumn judge_soc_column(const Recording& recording, double capacity_ah) {
  if (recording.soc_ref.size() != recording.rows() || recording.rows() == 0) return {};
  return Judge(recording, capacity_ah).judge();
}

}  // namespace bms::measurement
