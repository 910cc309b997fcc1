#include "diagnosis/pack/loose_wires.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "diagnosis/pack/pack_thresholds.hpp"
#include "measurement/spans.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::Wires& of_wires = limits.wires;

/// Of two neighbours, by the rows in which both and most others have a reading.
struct Pair {
  std::vector<std::size_t> row;
  std::vector<double> half_difference_v, sum_v, current_a;
  std::vector<double> before_v, after_v;  ///< the cells on both sides, against the others; NaN: none
  std::vector<double> others_v;
};

/// Median of the cells other than c and c + 1 in this row.
double median_of_others(const PackRecording& pack, std::size_t c, std::size_t row, std::vector<double>& space) {
  space.clear();
  for (std::size_t other = 0; other < pack.cells(); ++other) {
    if (other != c && other != c + 1 && std::isfinite(pack.cell_v[other][row]))
      space.push_back(pack.cell_v[other][row]);
  }
  return space.empty() ? no_value : measurement::median(space);
}

Pair pair_of(const PackRecording& pack, std::size_t c) {
  Pair p;
  std::vector<double> space;
  for (std::size_t k = 0; k < pack.rows(); ++k) {
    const double a = pack.cell_v[c][k], b = pack.cell_v[c + 1][k];
    const double others = median_of_others(pack, c, k, space);
    if (!std::isfinite(a + b + others + pack.current_a[k])) continue;
    p.row.push_back(k);
    p.half_difference_v.push_back((a - b) / 2);
    p.sum_v.push_back((a + b) / 2 - others);
    p.current_a.push_back(pack.current_a[k]);
    p.before_v.push_back(c > 0 ? pack.cell_v[c - 1][k] - others : no_value);
    p.after_v.push_back(c + 2 < pack.cells() ? pack.cell_v[c + 2][k] - others : no_value);
    p.others_v.push_back(others);
  }
  return p;
}

/// Without what goes with the current: the cells' resistances differ.
std::vector<double> without_current(const Pair& p, std::vector<double> of_v, double quiet_a) {
  std::vector<double> ratios;
  for (std::size_t k = 1; k < p.row.size(); ++k) {
    const double di = p.current_a[k] - p.current_a[k - 1], dv = of_v[k] - of_v[k - 1];
    if (std::abs(di) > quiet_a && std::isfinite(dv)) ratios.push_back(dv / di);
  }
  if (ratios.size() < of_wires.least_steps) return of_v;
  const double ohm = measurement::median(ratios);
  for (std::size_t k = 0; k < of_v.size(); ++k) of_v[k] -= ohm * p.current_a[k];
  return of_v;
}

/// By how much half the difference may be off because its two channels are read at different moments between the rows
/// before and after: half of what the voltage does there.
double unknown_moment(const Pair& p, std::size_t k) {
  const auto first = p.others_v.begin() + static_cast<std::ptrdiff_t>(k > 0 ? k - 1 : 0);
  const auto end = p.others_v.begin() + static_cast<std::ptrdiff_t>(std::min(k + 2, p.others_v.size()));
  const auto [low, high] = std::minmax_element(first, end);
  return (*high - *low) / 2;
}

/// The level of the summed leaps by row, and from which size on two levels differ.
struct Levels {
  std::vector<double> of_row_v;
  double leap_v = 0;
  std::vector<double> leaps_v;  ///< sizes; none where they are not those of a contact
};

/// What else moves with the leaps, over their size: 0 at a bad wire.
class Along {
 public:
  void add(double leap_v, double other_v) {
    if (!std::isfinite(other_v)) return;
    product_ += leap_v * other_v;
    square_ += leap_v * leap_v;
  }
  double share() const { return square_ > 0 ? std::abs(product_) / square_ : 0; }

 private:
  double product_ = 0, square_ = 0;
};

/// A level that was there before, if this is nearly one: the error of each leap does not add up.
double known_level(std::vector<double>& known_v, double level_v, double within_v) {
  const auto nearest = std::min_element(known_v.begin(), known_v.end(), [&](double x, double y) {
    return std::abs(x - level_v) < std::abs(y - level_v);
  });
  if (nearest != known_v.end() && std::abs(*nearest - level_v) < within_v) return *nearest;
  known_v.push_back(level_v);
  return level_v;
}

/// The smallest change of half the difference: half of the resolution of a coarse reading. 0 if nothing changes.
double digit_of(const Pair& p) {
  double digit_v = std::numeric_limits<double>::infinity();
  for (std::size_t k = 1; k < p.row.size(); ++k) {
    const double v = std::abs(p.half_difference_v[k] - p.half_difference_v[k - 1]);
    if (v > of_wires.least_digit_v) digit_v = std::min(digit_v, v);
  }
  return std::isfinite(digit_v) ? digit_v : 0;
}

/// Half the difference of a pair by row, and what it may be off.
class Readings {
 public:
  Readings(const Pair& p, std::vector<double> half_v) : half_v_(std::move(half_v)) {
    for (std::size_t k = 0; k < half_v_.size(); ++k) unknown_v_.push_back(unknown_moment(p, k));
    std::vector<double> sizes_v;
    for (std::size_t k = 1; k < half_v_.size(); ++k) sizes_v.push_back(std::abs(half_v_[k] - half_v_[k - 1]));
    const double sigma_v = measurement::median(sizes_v) / abs_median_of_normal;
    leap_v_ = std::max({of_wires.least_v, of_wires.sigmas * sigma_v, of_wires.digits * digit_of(p)});
  }

  double leap_v() const { return leap_v_; }
  double between(std::size_t from, std::size_t to) const { return half_v_[to] - half_v_[from]; }
  /// From a row that is known to have the level.
  bool is_leap(std::size_t from, std::size_t to) const {
    return std::abs(between(from, to)) > leap_v_ + unknown_v_[to] + drift(from, to);
  }
  bool is_same(std::size_t from, std::size_t to) const { return std::abs(between(from, to)) <= leap_v_; }
  /// `to` says as much of the level as `from`, of which the cells' drift makes less with each row.
  bool replaces(std::size_t from, std::size_t to) const {
    return is_same(from, to) && unknown_v_[to] <= std::max(leap_v_, unknown_v_[from]) + drift(from, to);
  }
  /// Two rows that lie nearer together than either is to another one.
  bool are_together(std::size_t a, std::size_t b, std::size_t other) const {
    return std::abs(between(a, b)) < of_wires.same_level * std::abs(between(other, a)) + leap_v_ / 2;
  }

 private:
  /// What the cells may drift apart from row to row.
  double drift(std::size_t from, std::size_t to) const {
    return leap_v_ * static_cast<double>(to - from) / static_cast<double>(of_wires.rows_of_one_leap);
  }

  std::vector<double> half_v_, unknown_v_;
  double leap_v_ = 0;
};

Levels levels_of(const Pair& p, double quiet_a) {
  Levels levels;
  const Readings readings(p, without_current(p, p.half_difference_v, quiet_a));
  const std::vector<double> sum_v = without_current(p, p.sum_v, quiet_a),
                            before_v = without_current(p, p.before_v, quiet_a),
                            after_v = without_current(p, p.after_v, quiet_a);
  levels.leap_v = readings.leap_v();
  levels.of_row_v.assign(p.row.size(), 0);
  double level_v = 0;
  std::vector<double> known_v = {0};
  Along sum, before, after;
  std::size_t last = 0;  // row that has the level
  std::vector<double> odd_v;
  for (std::size_t k = 1; k < p.row.size(); ++k) {
    levels.of_row_v[k] = level_v;
    // a contact stays bad for more than a row: what the load does between two channels is gone in the next one
    const bool stays = k + 1 < p.row.size() && readings.are_together(k, k + 1, last);
    const bool leaps = readings.is_leap(last, k) && stays;
    const double leap_v = readings.between(last, k), along_v = sum_v[k] - sum_v[last];
    if (!leaps) {
      if (!stays && !readings.is_same(last, k)) odd_v.push_back(std::abs(leap_v));
      if (readings.replaces(last, k)) last = k;
      continue;
    }
    if (std::abs(along_v) < of_wires.single_cell * std::abs(leap_v)) {
      sum.add(leap_v, along_v);
      before.add(leap_v, before_v[k] - before_v[last]);
      after.add(leap_v, after_v[k] - after_v[last]);
      const double within_v = std::max(levels.leap_v / 2, of_wires.same_level * std::abs(leap_v));
      level_v = known_level(known_v, level_v + leap_v, within_v);
      levels.leaps_v.push_back(std::abs(leap_v));
      for (std::size_t j = last + 1; j <= k; ++j) {
        if (std::abs(readings.between(j, k)) < std::abs(readings.between(last, j))) levels.of_row_v[j] = level_v;
      }
    }
    last = k;
  }
  // where single rows are odd by as much more often, two of them are alike by chance
  const double usual_v = levels.leaps_v.empty() ? 0 : measurement::median(levels.leaps_v);
  const auto odd = static_cast<std::size_t>(
      std::count_if(odd_v.begin(), odd_v.end(), [&](double v) { return v > (1 - of_wires.same_level) * usual_v; }));
  const double along = std::max({sum.share(), before.share(), after.share()});
  if (odd > levels.leaps_v.size() || along > of_wires.most_along) levels.leaps_v.clear();
  return levels;
}

/// The level in which most rows are.
double usual_level(const Levels& levels) {
  std::map<long, std::pair<std::size_t, double>> bins;  // count and sum
  for (const double v : levels.of_row_v) {
    auto& [count, sum] = bins[std::lround(v / (levels.leap_v / 2))];
    ++count;
    sum += v;
  }
  const auto most = std::max_element(bins.begin(), bins.end(),
                                     [](const auto& x, const auto& y) { return x.second.first < y.second.first; });
  return most->second.second / static_cast<double>(most->second.first);
}

PackFinding finding_of(const PackRecording& pack, const Pair& p, std::size_t c, const std::vector<char>& bad,
                       std::size_t rows, std::vector<double> leaps_v) {
  PackFinding f;
  f.cause = Cause::sense_wire;
  f.cell = c;
  f.probability = 1;
  f.value = measurement::median(leaps_v);
  for (double& v : leaps_v) v = std::abs(v - f.value);
  f.sigma = std::max(measurement::median(leaps_v) / abs_median_of_normal, of_wires.least_sigma_v);
  const auto stretches = measurement::consecutive_rows(bad.size(), [&](std::size_t k) { return bad[k] != 0; });
  std::string times;
  const double start_s = pack.time_s.front();
  for (std::size_t k = 0; k < std::min(stretches.size(), of_wires.named); ++k)
    times += fmt::format("{}{:.0f} to {:.0f} s", k == 0 ? "" : ", ", pack.time_s[p.row[stretches[k].begin]] - start_s,
                         pack.time_s[p.row[stretches[k].end - 1]] - start_s);
  if (stretches.size() > of_wires.named) times += fmt::format(" and {} more times", stretches.size() - of_wires.named);
  f.because = fmt::format("Its contact is intermittent: bad in {:.1f} % of the rows, from {}. The rows are left out.",
                          100 * static_cast<double>(rows) / static_cast<double>(pack.rows()), times);
  return f;
}

}  // namespace

std::vector<LooseWire> take_loose_wires(PackRecording& pack, double quiet_a) {
  std::vector<LooseWire> wires;
  for (std::size_t c = 0; c + 1 < pack.cells() && pack.cells() > 2; ++c) {
    const Pair p = pair_of(pack, c);
    if (p.row.size() < of_wires.least_rows) continue;
    const Levels levels = levels_of(p, quiet_a);
    if (levels.leaps_v.empty()) continue;
    const double usual_v = usual_level(levels);
    std::vector<char> bad;
    for (const double v : levels.of_row_v) bad.push_back(std::abs(v - usual_v) > levels.leap_v / 2 ? 1 : 0);
    const auto rows = static_cast<std::size_t>(std::count(bad.begin(), bad.end(), 1));
    if (rows < (levels.leaps_v.size() == 1 ? of_wires.rows_of_one_leap : of_wires.rows)) continue;
    wires.push_back({c, rows, finding_of(pack, p, c, bad, rows, levels.leaps_v)});
    for (std::size_t k = 0; k < bad.size(); ++k) {
      if (bad[k] != 0) pack.cell_v[c][p.row[k]] = pack.cell_v[c + 1][p.row[k]] = no_value;
    }
  }
  return wires;
}

void add_loose_wires(const std::vector<LooseWire>& wires, std::size_t rows, std::vector<PackFinding>& findings) {
  for (const LooseWire& wire : wires) {
    const double share = static_cast<double>(wire.rows) / static_cast<double>(rows);
    std::erase_if(findings, [&](const PackFinding& f) {
      return f.cause == Cause::missing && (f.cell == wire.cell || f.cell == wire.cell + 1) &&
             f.value - share < limits.channels.missing_share;
    });
    findings.push_back(wire.finding);
  }
}

}  // namespace bms::diagnosis::pack
