#include "identification/ocv_curve.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace bms::identification {

namespace {

constexpr int grid = 1000;  // steps of SOC
const double unknown = std::numeric_limits<double>::quiet_NaN();

/// One run on the grid, NaN where it has not been; and the rested voltages before and after it.
struct Run {
  std::vector<double> voltage_v = std::vector<double>(grid + 1, unknown);
  bool charges = false;
  double moved_ah = 0, largest_a = 0, rested_before_v = 0, rested_after_v = 0;
};

struct Moved {
  double charged_as = 0, discharged_as = 0, largest_a = 0;
  bool charges() const { return charged_as > discharged_as; }
  double moved_as() const { return std::max(charged_as, discharged_as); }
};

Moved moved_charge(const Data& d) {
  Moved moved;
  for (std::size_t k = 1; k < d.size(); ++k) {
    const double as = d.current_a[k] * (d.time_s[k] - d.time_s[k - 1]);
    (as > 0 ? moved.charged_as : moved.discharged_as) += std::abs(as);
    moved.largest_a = std::max(moved.largest_a, std::abs(d.current_a[k]));
  }
  return moved;
}

void require_slow_run(const Moved& moved) {
  if (std::min(moved.charged_as, moved.discharged_as) > 0.01 * moved.moved_as())
    throw std::invalid_argument("an OCV recording that both charges and discharges");
  if (moved.largest_a > moved.moved_as() / 3'600 / 8)
    throw std::invalid_argument("an OCV recording faster than C/8: its voltage is not an open-circuit voltage");
}

std::vector<double> counted_soc(const Data& d, const Moved& moved) {
  std::vector<double> soc;
  double s = moved.charges() ? 0 : 1;
  for (std::size_t k = 0; k < d.size(); ++k) {
    if (k > 0) s += d.current_a[k] * (d.time_s[k] - d.time_s[k - 1]) / moved.moved_as();
    soc.push_back(s);
  }
  return soc;
}

/// Weighted voltages on the grid; first and last sample of the part of a run that moves charge.
struct Gridded {
  std::vector<double> sum = std::vector<double>(grid + 1, 0), weight = std::vector<double>(grid + 1, 0);
  std::size_t first, last = 0;

  void add(std::size_t point, double part, double voltage_v) {
    sum[point] += part * voltage_v;
    weight[point] += part;
  }
};

/// A grid point gets the mean of the samples within one step of it, weighted by their distance.
Gridded gridded(const Data& d, const measurement::Column& soc, double largest_a) {
  Gridded g;
  g.first = d.size();
  for (std::size_t k = 1; k < d.size(); ++k) {
    if (std::abs(d.current_a[k]) < 0.2 * largest_a || !std::isfinite(d.voltage_v[k])) continue;
    g.first = std::min(g.first, k);
    g.last = k;
    const double at = soc[k] * grid;
    if (!(at > -1 && at < grid + 1)) continue;
    const int below = static_cast<int>(std::floor(at));
    const double above_part = at - below;
    if (below >= 0) g.add(static_cast<std::size_t>(below), 1 - above_part, d.voltage_v[k]);
    if (below < grid) g.add(static_cast<std::size_t>(below + 1), above_part, d.voltage_v[k]);
  }
  return g;
}

/// Means at the grid points, with straight lines over gaps.
void fill_voltages(const Gridded& g, std::vector<double>& voltage_v) {
  constexpr double least_weight = 0.2;
  std::size_t from = grid + 1, to = 0;
  for (std::size_t k = 0; k <= grid; ++k) {
    if (g.weight[k] < least_weight) continue;
    voltage_v[k] = g.sum[k] / g.weight[k];
    from = std::min(from, k);
    to = k;
  }
  for (std::size_t k = from, known = from; k <= to; ++k) {
    if (!std::isfinite(voltage_v[k])) continue;
    for (std::size_t j = known + 1; j < k; ++j) {
      voltage_v[j] = voltage_v[known] + (voltage_v[k] - voltage_v[known]) * static_cast<double>(j - known) /
                                            static_cast<double>(k - known);
    }
    known = k;
  }
}

Run on_grid(const SlowRun& slow) {
  constexpr std::size_t fewest_samples = 100;
  constexpr double least_coverage = 0.8;  // of SOC
  const Data& d = slow.data;
  if (d.size() < fewest_samples) throw std::invalid_argument("an OCV recording with fewer than 100 samples");
  const Moved moved = moved_charge(d);
  require_slow_run(moved);
  const measurement::Column soc = slow.soc.empty() ? measurement::Column(counted_soc(d, moved)) : slow.soc;
  const Gridded g = gridded(d, soc, moved.largest_a);
  const auto [lowest, highest] = std::minmax_element(soc.begin(), soc.end());
  if (g.first >= g.last || *highest - *lowest < least_coverage)
    throw std::invalid_argument("an OCV recording over less than 80 % of the state of charge");
  Run run;
  run.charges = moved.charges();
  run.moved_ah = moved.moved_as() / 3'600;
  run.largest_a = moved.largest_a;
  fill_voltages(g, run.voltage_v);
  run.rested_before_v = d.voltage_v[g.first - 1];
  run.rested_after_v = d.voltage_v.back();
  return run;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Mean of all charges, or of all discharges, on the grid.
std::vector<double> averaged(const std::vector<Run>& runs, bool charges) {
  std::vector<double> mean(grid + 1, unknown);
  for (std::size_t g = 0; g <= grid; ++g) {
    std::vector<double> values;
    for (const Run& run : runs) {
      if (run.charges == charges && std::isfinite(run.voltage_v[g])) values.push_back(run.voltage_v[g]);
    }
    if (!values.empty()) mean[g] = mean_of(values);
  }
  return mean;
}

/// Rested voltage of the full (or empty) cell: at the end of runs that lead there, at the start of the others.
std::optional<double> rested(const std::vector<Run>& runs, bool full) {
  std::vector<double> values;
  for (const Run& run : runs) values.push_back(run.charges == full ? run.rested_after_v : run.rested_before_v);
  if (values.empty()) return std::nullopt;
  return mean_of(values);
}

bool known(double v) { return std::isfinite(v); }

/// Half of the distance where both runs have been, constant beyond; 0 with one kind of run.
std::vector<double> half_gap(const std::vector<double>& up, const std::vector<double>& down) {
  std::vector<double> half(grid + 1, 0);
  std::size_t both_from = grid + 1, both_to = 0;
  for (std::size_t g = 0; g <= grid; ++g) {
    if (!known(up[g]) || !known(down[g])) continue;
    half[g] = (up[g] - down[g]) / 2;
    both_from = std::min(both_from, g);
    both_to = g;
  }
  for (std::size_t g = 0; both_from <= grid && g <= grid; ++g) half[g] = half[std::clamp(g, both_from, both_to)];
  return half;
}

std::vector<double> middle(const std::vector<double>& up, const std::vector<double>& down,
                           const std::vector<double>& half) {
  std::vector<double> ocv(grid + 1, unknown);
  for (std::size_t g = 0; g <= grid; ++g) {
    if (known(up[g]) && known(down[g]))
      ocv[g] = (up[g] + down[g]) / 2;
    else if (known(up[g]))
      ocv[g] = up[g] - half[g];
    else if (known(down[g]))
      ocv[g] = down[g] + half[g];
  }
  return ocv;
}

/// Under current the last percent bends into the cut-off voltage: a straight line from there to the rested voltage.
void anchor(std::size_t from, std::size_t end, std::optional<double> rested_v, std::vector<double>& ocv) {
  if (!rested_v || !known(ocv[from])) return;
  const bool rising = end > from;
  const double end_v = rising ? std::max(*rested_v, ocv[from]) : std::min(*rested_v, ocv[from]);
  const double width = std::abs(static_cast<double>(end) - static_cast<double>(from));
  for (std::size_t k = 1; k <= static_cast<std::size_t>(width); ++k) {
    ocv[rising ? from + k : from - k] = ocv[from] + (end_v - ocv[from]) * static_cast<double>(k) / width;
  }
}

}  // namespace

OcvCurve ocv_curve(const std::vector<SlowRun>& slow_runs) {
  if (slow_runs.empty()) throw std::invalid_argument("no OCV recording");
  std::vector<Run> runs;
  for (const SlowRun& slow : slow_runs) runs.push_back(on_grid(slow));

  OcvCurve curve;
  std::vector<double> charged, discharged, all;
  for (const Run& run : runs) {
    (run.charges ? charged : discharged).push_back(run.moved_ah);
    all.push_back(run.moved_ah);
    curve.largest_a += run.largest_a / static_cast<double>(runs.size());
  }
  curve.capacity_ah = mean_of(all);
  if (!charged.empty() && !discharged.empty()) curve.coulombic_efficiency = mean_of(discharged) / mean_of(charged);

  if (charged.empty()) curve.branch = -1;
  if (discharged.empty()) curve.branch = 1;

  const auto up = averaged(runs, true), down = averaged(runs, false);
  curve.charge_v = up;
  curve.discharge_v = down;
  curve.half_gap_v = half_gap(up, down);
  curve.ocv_v = middle(up, down, curve.half_gap_v);
  constexpr auto bend = static_cast<std::size_t>(unmeasured_end * grid);
  anchor(bend, 0, rested(runs, false), curve.ocv_v);
  anchor(grid - bend, grid, rested(runs, true), curve.ocv_v);
  if (!std::all_of(curve.ocv_v.begin(), curve.ocv_v.end(), known))
    throw std::invalid_argument("the OCV recordings do not cover a part of the state of charge");
  for (int g = 0; g <= grid; ++g) curve.soc.push_back(static_cast<double>(g) / grid);
  return curve;
}

}  // namespace bms::identification
