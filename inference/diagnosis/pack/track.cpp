#include "diagnosis/pack/track.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "diagnosis/pack/current_kind.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/shared_blocks.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

/// Mean over the rows around each row; NaN where there is no value.
std::vector<double> moving_mean(const std::vector<double>& values, std::size_t reach) {
  std::vector<double> means(values.size(), no_value);
  double sum = 0, count = 0;
  const auto add = [&](std::size_t k, double sign) {
    if (k >= values.size() || !std::isfinite(values[k])) return;
    sum += sign * values[k];
    count += sign;
  };
  for (std::size_t k = 0; k < reach; ++k) add(k, 1);
  for (std::size_t k = 0; k < values.size(); ++k) {
    add(k + reach, 1);
    if (k > reach) add(k - reach - 1, -1);
    if (count > 0 && std::isfinite(values[k])) means[k] = sum / count;
  }
  return means;
}

/// Returns true if the current changes before or after this row.
bool moves(const Track& track, const PackRecording& pack, std::size_t k) {
  const double quiet_a = limits.noise.quiet_c * track.capacity_ah, now_a = pack.current_a[k];
  const auto differs = [&](std::size_t other) { return !(std::abs(pack.current_a[other] - now_a) <= quiet_a); };
  return (k > 0 && differs(k - 1)) || (k + 1 < pack.rows() && differs(k + 1));
}

/// Without noise where the current is constant: there, the model and the mean difference to it.
void set_smooth(Track& track, const PackRecording& pack) {
  std::vector<double> apart_v(pack.rows(), no_value);
  track.moving.assign(pack.rows(), 0);
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    track.moving[k] = moves(track, pack, k) ? 1 : 0;
    if (track.moving[k] == 0) apart_v[k] = track.neighbours_v[k] - track.model_v[k];
  }
  track.smooth_v = track.neighbours_v;
  const std::vector<double> mean_v = moving_mean(apart_v, limits.smooth_rows);
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    if (std::isfinite(mean_v[k])) track.smooth_v[k] = track.model_v[k] + mean_v[k];
  }
}

/// What the neighbours' voltage says of the current beyond its mean over the row: fast differences to the model only.
void set_instant(Track& track, const PackRecording& pack) {
  track.instant_a = pack.current_a;
  double slow_v = no_value, last_s = pack.time_s.front();
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    const double apart_v = track.neighbours_v[k] - track.model_v[k];
    if (!std::isfinite(apart_v)) continue;
    if (!std::isfinite(slow_v)) slow_v = apart_v;
    const double step_s = pack.time_s[k] - last_s;
    last_s = pack.time_s[k];
    const double next_a = k + 1 < pack.rows() ? pack.current_a[k + 1] : pack.current_a[k];
    // where the current is constant the measured one is better; a single reading is seldom of the neighbours' moment
    if (std::abs(next_a - pack.current_a[k]) > limits.noise.quiet_c * track.capacity_ah)
      track.instant_a[k] += (apart_v - slow_v) / track.r0_by_row_ohm[k];
    slow_v += -std::expm1(-std::max(step_s, 0.0) / (limits.instant_rows * track.step_s)) * (apart_v - slow_v);
  }
}

}  // namespace

double usual_step_s(const PackRecording& pack) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < pack.rows(); ++k) steps.push_back(pack.time_s[k] - pack.time_s[k - 1]);
  return std::max(measurement::median(steps), std::numeric_limits<double>::epsilon());
}

RcVoltage rc_voltage_of(const Track& track, const PackRecording& pack, double ln_factor) {
  RcVoltage p;
  const double factor = std::exp(ln_factor);
  double v = 0, by_tau_v = 0, last_s = pack.time_s.front();
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    const double mean_a = mean_current_a(pack, k), current_a = std::isfinite(mean_a) ? mean_a : 0;
    const double share = (pack.time_s[k] - last_s) / (factor * track.tau_s[k]);
    last_s = pack.time_s[k];
    const double missing_v = track.r1_by_row_ohm[k] * current_a - v, passed = -std::expm1(-share);
    by_tau_v = (1 - passed) * (by_tau_v - share * missing_v);
    v += passed * missing_v;
    p.v.push_back(v);
    p.by_tau_v.push_back(by_tau_v);
  }
  return p;
}

Track track_of(const model::CellParameters<>& cell, const PackRecording& pack, const std::vector<double>& factor,
               double polarisation) {
  const PreparedCell prepared = model::prepare<double, model::max_intervals>(cell);
  Track t;
  t.cell = prepared;
  t.r0_ohm = model::look_up(t.cell, 0.5).r0_ohm;
  t.ocv_tolerance_v = cell.tolerance.ocv_v;
  t.capacity_ah = cell.capacity_ah;
  t.is_calibrated = !factor.empty();
  t.soc = pack.soc;
  t.step_s = usual_step_s(pack);
  std::uint8_t interval = 0;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    const double current_a = std::isfinite(pack.current_a[k]) ? pack.current_a[k] : 0;
    const auto at = model::look_up(t.cell, t.soc[k], interval);
    const double f = factor.empty() ? 1 : factor[k];
    t.r0_by_row_ohm.push_back(f * at.r0_ohm);
    t.r1_by_row_ohm.push_back(std::max(limits.shared.least_factor, f + polarisation) * at.r1_ohm);
    t.tau_s.push_back(at.r1_ohm * at.c1_f);
    t.model_v.push_back(at.ocv_v + f * at.r0_ohm * current_a);
    t.days.push_back((pack.time_s[k] - pack.time_s.front()) / (limits.hours_per_day * 3600));
  }
  t.v_rc_v = rc_voltage_of(t, pack, 0).v;
  const auto half = model::look_up(t.cell, 0.5);
  t.unseen_share = -std::expm1(-t.step_s / (half.r1_ohm * half.c1_f)) * half.r1_ohm / half.r0_ohm;
  t.warm_k = warmer_than_at_start(pack);
  for (double& k : t.warm_k) k = std::max(0.0, k);
  for (std::size_t k = 0; k < pack.rows(); ++k) t.model_v[k] += t.v_rc_v[k];
  return t;
}

namespace {

void set_mean(Track& track, const PackRecording& pack, const std::vector<std::size_t>& reference, bool by_voltmeter) {
  // by cell: mean difference to the mean, so that a missing reading does not shift the mean of the others
  std::vector<double> shift(reference.size(), 0.0), count(reference.size(), 0.0);
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    double sum = 0;
    std::size_t finite = 0;
    for (const std::size_t c : reference) {
      sum += pack.cell_v[c][k];
      if (std::isfinite(pack.cell_v[c][k])) ++finite;
    }
    if (finite < reference.size()) continue;
    for (std::size_t r = 0; r < reference.size(); ++r) {
      shift[r] += pack.cell_v[reference[r]][k] - sum / static_cast<double>(finite);
      ++count[r];
    }
  }
  for (std::size_t r = 0; r < reference.size(); ++r) shift[r] = count[r] > 0 ? shift[r] / count[r] : 0;
  track.neighbours_v.assign(pack.rows(), no_value);
  const double cells = static_cast<double>(pack.cells());
  std::vector<double> differences;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    double sum = 0;
    std::size_t finite = 0;
    for (std::size_t r = 0; r < reference.size(); ++r) {
      const double v = pack.cell_v[reference[r]][k] - shift[r];
      if (!std::isfinite(v)) continue;
      sum += v;
      ++finite;
    }
    if (2 * finite < reference.size() || finite == 0) continue;
    track.neighbours_v[k] = sum / static_cast<double>(finite);
    if (!pack.pack_v.empty()) differences.push_back(pack.pack_v[k] / cells - track.neighbours_v[k]);
  }
  if (pack.pack_v.empty() || !by_voltmeter) return;
  const double apart_v = differences.empty() ? 0 : measurement::median(differences);
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    if (!std::isfinite(track.neighbours_v[k])) track.neighbours_v[k] = pack.pack_v[k] / cells - apart_v;
  }
}

}  // namespace

void set_neighbours(Track& track, const PackRecording& pack, const std::vector<std::size_t>& reference,
                    bool by_voltmeter) {
  set_mean(track, pack, reference, by_voltmeter);
  track.mean_v = measurement::mean(track.neighbours_v);
  set_instant(track, pack);
  set_smooth(track, pack);
  track.slow_a = moving_mean(track.instant_a, limits.blur_rows);
}

std::vector<std::size_t> usual_cells(const PackRecording& pack) {
  const std::size_t cells = pack.cells();
  std::vector<double> square(cells, 0.0), count(cells, 0.0), row;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    row.clear();
    for (const auto& v : pack.cell_v) row.push_back(v[k]);
    const double middle = measurement::quantile(row, 0.5);
    for (std::size_t c = 0; c < cells; ++c) {
      const double apart = pack.cell_v[c][k] - middle;
      if (!std::isfinite(apart)) continue;
      square[c] += apart * apart;
      ++count[c];
    }
  }
  std::vector<std::size_t> order(cells);
  for (std::size_t c = 0; c < cells; ++c) {
    order[c] = c;
    square[c] = count[c] > 0 ? square[c] / count[c] : std::numeric_limits<double>::infinity();
  }
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return square[a] < square[b]; });
  order.resize(std::max<std::size_t>(1, (cells + 1) / 2));
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace bms::diagnosis::pack
