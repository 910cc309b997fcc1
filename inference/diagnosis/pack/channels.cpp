#include "diagnosis/pack/channels.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "diagnosis/noise.hpp"
#include "diagnosis/pack/pack_thresholds.hpp"
#include "diagnosis/pack/pack_verdict.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::Channels& of_channels = limits.channels;

/// Voltage by which the model must move between two rows so that a reading of this channel must change.
double moving_v(std::span<const double> readings, const Track& track, const PackRecording& pack) {
  double step_v = 0;
  if (std::any_of(readings.begin(), readings.end(), [](double v) { return std::isfinite(v); }))
    step_v = quantisation_step(readings);
  const double white_v = white_noise(readings, pack.current_a, limits.noise.quiet_c * track.capacity_ah, 0);
  return std::max(of_channels.moving_at_least_v, of_channels.moving_steps * std::max(step_v, white_v));
}

/// Median time between changes of the reading, of stretches in which the model moves.
double time_between_changes(const std::vector<double>& v, const Track& track, const PackRecording& pack,
                            double most_v) {
  std::vector<double> times;
  std::size_t changed = 0;
  double low = track.model_v[0], high = low;
  for (std::size_t k = 1; k < v.size(); ++k) {
    low = std::min(low, track.model_v[k]);
    high = std::max(high, track.model_v[k]);
    if (!std::isfinite(v[k]) || v[k] == v[changed]) continue;
    if (high - low > most_v) times.push_back(pack.time_s[k] - pack.time_s[changed]);
    changed = k;
    low = high = track.model_v[k];
  }
  return times.empty() ? 0 : measurement::median(times);
}

/// Voltage over current at steps of the current between two rows.
class ApparentResistance {
 public:
  void add(double dv, double di) {
    if (!std::isfinite(dv)) return;
    product_ += dv * di;
    square_ += di * di;
  }
  double ohm() const { return square_ > 0 ? product_ / square_ : 0; }

 private:
  double product_ = 0, square_ = 0;
};

/// Counts moving rows, and those in which the reading did not change.
ChannelState frozen_rows(const std::vector<double>& v, const Track& track, const PackRecording& pack, double most_v) {
  ChannelState s;
  ApparentResistance fresh, stale;
  std::size_t frozen = 0, absent = 0, changed = 0;
  for (std::size_t k = 0; k < v.size(); ++k) {
    if (!std::isfinite(v[k])) ++absent;
    if (k == 0 || !std::isfinite(v[k]) || !std::isfinite(v[k - 1])) continue;
    const bool same = v[k] == v[k - 1];
    if (std::abs(track.model_v[k] - track.model_v[k - 1]) > most_v) {
      ++s.moving_rows;
      if (same) ++frozen;
    }
    const double di = pack.current_a[k] - pack.current_a[k - 1], since = pack.current_a[k] - pack.current_a[changed];
    const double step_a = of_channels.step_c * track.capacity_ah;
    if (same && std::abs(di) > step_a) stale.add(v[k] - v[k - 1], di);
    if (!same && std::abs(since) > step_a) fresh.add(v[k] - v[changed], since);
    if (!same) changed = k;
  }
  s.missing_share = static_cast<double>(absent) / static_cast<double>(v.size());
  if (s.moving_rows > 0) s.frozen_share = static_cast<double>(frozen) / static_cast<double>(s.moving_rows);
  s.fresh_ohm = fresh.ohm();
  s.stale_ohm = stale.ohm();
  return s;
}

/// Changes from row to row, and the median of those of the other cells. Not of the median voltage: where the cells lie
/// apart, it is the voltage of one cell, and behind itself no cell is late.
class OtherCells {
 public:
  explicit OtherCells(const std::vector<std::vector<double>>& cell_v) {
    std::vector<double> changes;
    for (std::size_t k = 1; k < cell_v.front().size(); ++k) {
      changes.clear();
      for (const auto& v : cell_v) {
        if (std::isfinite(v[k] - v[k - 1])) changes.push_back(v[k] - v[k - 1]);
      }
      std::sort(changes.begin(), changes.end());
      middle_.push_back(middle_of(changes));
    }
  }

  /// By row; NaN where no other cell has a change.
  std::vector<double> changes_without(const std::vector<double>& v) const {
    std::vector<double> changes(v.size(), no_value);
    for (std::size_t k = 1; k < v.size(); ++k) changes[k] = without(middle_[k - 1], v[k] - v[k - 1]);
    return changes;
  }

 private:
  /// The changes around the median: the next lower and the next higher one, and between them that of an odd number.
  struct Middle {
    double low = no_value, median = no_value, high = no_value;
  };

  static Middle middle_of(const std::vector<double>& sorted) {
    const std::size_t n = sorted.size(), half = n / 2;
    if (n < 2) return {};
    if (n % 2 == 0) return {sorted[half - 1], no_value, sorted[half]};
    return {sorted[half - 1], sorted[half], sorted[half + 1]};
  }
  /// The median without `own`, which is among them if it is finite.
  static double without(const Middle& m, double own) {
    if (!std::isfinite(own)) return std::isfinite(m.median) ? m.median : (m.low + m.high) / 2;
    if (!std::isfinite(m.median)) return own <= m.low ? m.high : m.low;
    if (own == m.median) return (m.low + m.high) / 2;
    return (m.median + (own < m.median ? m.high : m.low)) / 2;
  }

  std::vector<Middle> middle_;
};

std::vector<double> changes_of(const std::vector<double>& v) {
  std::vector<double> changes(v.size(), no_value);
  for (std::size_t k = 1; k < v.size(); ++k) changes[k] = v[k] - v[k - 1];
  return changes;
}

/// Squared difference of changes, over their square: of the first ones against the others `lag` rows before, with the
/// best factor.
double error_at_lag(const std::vector<double>& changes_v, const std::vector<double>& others_v, std::ptrdiff_t lag) {
  double vv = 0, vm = 0, mm = 0;
  const auto rows = static_cast<std::ptrdiff_t>(changes_v.size());
  for (std::ptrdiff_t k = std::max<std::ptrdiff_t>(1, 1 + lag); k < std::min(rows, rows + lag); ++k) {
    const double dv = changes_v[static_cast<std::size_t>(k)], dm = others_v[static_cast<std::size_t>(k - lag)];
    if (!std::isfinite(dv + dm)) continue;
    vv += dv * dv;
    vm += dv * dm;
    mm += dm * dm;
  }
  return mm > 0 && vv > 0 ? 1 - vm * std::max(vm, 0.0) / (vv * mm) : 1;
}

/// Returns true if the changes are alike `lag` rows later, within a row.
bool repeats(const std::vector<double>& changes_v, std::ptrdiff_t lag) {
  for (std::ptrdiff_t near = lag - 1; near <= lag + 1; ++near) {
    if (std::abs(near) > 1 && error_at_lag(changes_v, changes_v, near) < 1 - of_channels.lag_gain) return true;
  }
  return false;
}

/// Lag of the readings behind those of the other cells, whose changes are others_v, in whole rows. Not behind the
/// current: what it did within a row is unknown. Not by a time after which the load is alike: a channel that is read
/// some tenths of a row later than the others is then as well a period and those tenths late.
double best_lag(const std::vector<double>& v, const std::vector<double>& others_v, double step_s) {
  const auto rows_of = [&](double s) { return static_cast<std::ptrdiff_t>(s / step_s); };
  const std::vector<double> changes_v = changes_of(v);
  const double now = error_at_lag(changes_v, others_v, 0);
  double best = now;
  std::ptrdiff_t found = 0;
  const double last_s = std::max(of_channels.lag_to_s, of_channels.lag_rows * step_s);
  for (std::ptrdiff_t lag = rows_of(of_channels.lag_from_s); lag <= rows_of(last_s); ++lag) {
    const double error = error_at_lag(changes_v, others_v, lag);
    if (error >= best || repeats(others_v, lag)) continue;
    best = error;
    found = lag;
  }
  return best < now - of_channels.lag_gain ? static_cast<double>(found) * step_s : 0;
}

void keep_fresh_readings(std::vector<double>& v) {
  double last = no_value;
  for (double& reading : v) {
    const double now = reading;
    if (!std::isfinite(last) || reading == last) reading = no_value;
    if (std::isfinite(now)) last = now;
  }
}

/// By row: how far the model moves in the rows around it.
std::vector<double> movement_of(const Track& track) {
  std::vector<double> movement;
  const std::size_t rows = track.model_v.size(), reach = of_channels.moved_rows;
  for (std::size_t k = 0; k < rows; ++k) {
    const auto first = track.model_v.begin() + static_cast<std::ptrdiff_t>(k > reach ? k - reach : 0),
               last = track.model_v.begin() + static_cast<std::ptrdiff_t>(std::min(rows, k + reach + 1));
    const auto [low, high] = std::minmax_element(first, last);
    movement.push_back(*high - *low);
  }
  return movement;
}

/// Removes readings that differ from those around them by more than the pack moves, of a difference to the median cell.
std::size_t remove_glitches(std::vector<double>& v, const std::vector<double>& median_v,
                            const std::vector<double>& movement_v) {
  std::vector<double> apart(v.size()), around;
  for (std::size_t k = 0; k < v.size(); ++k) apart[k] = v[k] - median_v[k];
  std::size_t count = 0;
  double last_v = no_value;  // the common case is fast: nothing moved
  for (std::size_t k = 0; k < v.size(); ++k) {
    const double most_v = of_channels.glitch_v + 2 * movement_v[k];
    if (!std::isfinite(apart[k]) || std::abs(apart[k] - last_v) < most_v / 2) continue;
    const std::size_t first = k > of_channels.glitch_rows ? k - of_channels.glitch_rows : 0,
                      end = std::min(v.size(), k + of_channels.glitch_rows + 1);
    around.assign(apart.begin() + static_cast<std::ptrdiff_t>(first), apart.begin() + static_cast<std::ptrdiff_t>(end));
    const double middle = measurement::median(around);
    if (std::abs(apart[k] - middle) > most_v) {
      v[k] = no_value;
      ++count;
    } else {
      last_v = middle;
    }
  }
  return count;
}

}  // namespace

std::vector<std::size_t> Channels::repeated() const {
  std::vector<std::size_t> list;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (cells[k].held_s) list.push_back(k);
  }
  return list;
}

bool Channels::are_mostly_held() const {
  return static_cast<double>(repeated().size()) >= of_channels.most_channels * static_cast<double>(cells.size());
}

double Channels::usual_lag_s() const {
  std::vector<double> lags;
  for (const ChannelState& s : cells) lags.push_back(s.lag_s);
  return measurement::median(lags);
}

std::vector<std::size_t> Channels::late(double step_s) const {
  const double usual_s = usual_lag_s();
  std::vector<std::size_t> list;
  for (std::size_t k = 0; k < cells.size(); ++k) {
    if (!cells[k].held_s && std::abs(cells[k].lag_s - usual_s) > step_s * of_channels.late_rows) list.push_back(k);
  }
  const double most =
      std::max(1.0, of_channels.grouped_share * static_cast<double>(cells.size()));  // one is not a group
  if (static_cast<double>(list.size()) > most) list.clear();
  return list;
}

Channels check_channels(const Track& track, PackRecording& pack) {
  Channels channels;
  ApparentResistance of_pack;
  for (std::size_t k = 1; k < pack.rows() && !pack.pack_v.empty(); ++k) {
    const double di = pack.current_a[k] - pack.current_a[k - 1];
    if (std::abs(di) > of_channels.step_c * track.capacity_ah) of_pack.add(pack.pack_v[k] - pack.pack_v[k - 1], di);
  }
  if (!pack.pack_v.empty()) channels.pack_ohm = of_pack.ohm() / static_cast<double>(pack.cells());
  std::vector<double> row, median_v;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    row.clear();
    for (const auto& v : pack.cell_v) row.push_back(v[k]);
    median_v.push_back(measurement::median(row));
  }
  const std::vector<double> movement_v = movement_of(track);
  std::vector<std::size_t> glitches;
  for (std::vector<double>& v : pack.cell_v) glitches.push_back(remove_glitches(v, median_v, movement_v));
  const OtherCells others(pack.cell_v);
  for (std::vector<double>& v : pack.cell_v) {
    const double most_v = moving_v(v, track, pack);
    ChannelState s = frozen_rows(v, track, pack, most_v);
    if (s.moving_rows >= of_channels.moving_rows && s.frozen_share > of_channels.held_share) {
      s.held_s = time_between_changes(v, track, pack, most_v);
      keep_fresh_readings(v);
    } else {
      s.lag_s = best_lag(v, others.changes_without(v), track.step_s);
    }
    s.glitches = glitches[channels.cells.size()];
    channels.cells.push_back(s);
  }
  return channels;
}

void add_findings(const Channels& channels, std::vector<PackFinding>& findings) {
  const std::vector<std::size_t> repeated = channels.repeated();
  const auto add_held = [&](const std::vector<std::size_t>& cells) {
    std::vector<double> times;
    for (const std::size_t c : cells) times.push_back(*channels.cells[c].held_s);
    PackFinding f;
    f.cause = Cause::repeated;
    if (cells.size() == 1) f.cell = cells.front();
    f.cells = cells;
    f.value = measurement::median(times);
    for (double& t : times) t = std::abs(t - f.value);
    f.sigma = measurement::median(times) / abs_median_of_normal;
    f.probability = 1;
    findings.push_back(std::move(f));
  };
  if (channels.are_mostly_held()) {
    add_held(repeated);
  } else {
    for (const std::size_t c : repeated) add_held({c});
  }
  for (std::size_t c = 0; c < channels.cells.size(); ++c) {
    const double share = channels.cells[c].missing_share;
    if (share < of_channels.missing_share) continue;
    PackFinding f;
    f.cause = Cause::missing;
    f.cell = c;
    f.value = share;
    f.probability = 1;
    findings.push_back(std::move(f));
  }
}

}  // namespace bms::diagnosis::pack
