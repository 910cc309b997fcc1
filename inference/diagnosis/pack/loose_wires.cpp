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
  }
  return p;
}

/// Changes from row to row without what goes with the current: the cells' resistances differ.
std::vector<double> changes_of(const Pair& p, const std::vector<double>& of_v, double quiet_a) {
  std::vector<double> changes = {0}, ratios;
  for (std::size_t k = 1; k < p.row.size(); ++k) {
    const double di = p.current_a[k] - p.current_a[k - 1];
    changes.push_back(of_v[k] - of_v[k - 1]);
    if (std::abs(di) > quiet_a && std::isfinite(changes[k])) ratios.push_back(changes[k] / di);
  }
  if (ratios.size() < of_wires.least_steps) return changes;
  const double ohm = measurement::median(ratios);
  for (std::size_t k = 1; k < changes.size(); ++k) changes[k] -= ohm * (p.current_a[k] - p.current_a[k - 1]);
  return changes;
}

/// The level of the summed leaps by row, and from which size on two levels differ.
struct Levels {
  std::vector<double> of_row_v;
  double leap_v = 0;
  std::size_t leaps = 0;
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

Levels levels_of(const Pair& p, double quiet_a) {
  Levels levels;
  const std::vector<double> steps_v = changes_of(p, p.half_difference_v, quiet_a),
                            sums_v = changes_of(p, p.sum_v, quiet_a), before_v = changes_of(p, p.before_v, quiet_a),
                            after_v = changes_of(p, p.after_v, quiet_a);
  std::vector<double> sizes_v;
  for (const double v : steps_v) sizes_v.push_back(std::abs(v));
  const double sigma_v = measurement::median(sizes_v) / abs_median_of_normal;
  levels.leap_v = std::max({of_wires.least_v, of_wires.sigmas * sigma_v, of_wires.digits * digit_of(p)});
  double level_v = 0;
  std::vector<double> known_v = {0};
  Along sum, before, after;
  double moving = 0, moving_leaps = 0;  // rows in which the current steps
  for (std::size_t k = 0; k < p.row.size(); ++k) {
    const double leap_v = steps_v[k];
    const bool moves = k > 0 && std::abs(p.current_a[k] - p.current_a[k - 1]) > quiet_a;
    moving += moves ? 1 : 0;
    if (std::abs(leap_v) > levels.leap_v && std::abs(sums_v[k]) < of_wires.single_cell * std::abs(leap_v)) {
      moving_leaps += moves ? 1 : 0;
      sum.add(leap_v, sums_v[k]);
      before.add(leap_v, before_v[k]);
      after.add(leap_v, after_v[k]);
      level_v =
          known_level(known_v, level_v + leap_v, std::max(levels.leap_v / 2, of_wires.same_level * std::abs(leap_v)));
      ++levels.leaps;
    }
    levels.of_row_v.push_back(level_v);
  }
  // a wire does not know of the current: leaps that come with its steps are those of resistances and delays
  const double usual = moving / static_cast<double>(p.row.size());
  const bool by_current = moving_leaps > (usual + of_wires.more_with_current) * static_cast<double>(levels.leaps);
  if (by_current || std::max({sum.share(), before.share(), after.share()}) > of_wires.most_along) levels.leaps = 0;
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

PackFinding finding_of(const PackRecording& pack, const Pair& p, std::size_t c, const std::vector<double>& off_v,
                       const std::vector<char>& bad) {
  PackFinding f;
  f.cause = Cause::sense_wire;
  f.cell = c;
  f.probability = 1;
  std::vector<double> sizes;
  for (std::size_t k = 0; k < bad.size(); ++k) {
    if (bad[k] != 0) sizes.push_back(std::abs(off_v[k]));
  }
  f.value = measurement::median(sizes);
  for (double& v : sizes) v = std::abs(v - f.value);
  f.sigma = std::max(measurement::median(sizes), of_wires.least_sigma_v);
  const auto stretches = measurement::consecutive_rows(bad.size(), [&](std::size_t k) { return bad[k] != 0; });
  std::string times;
  const double start_s = pack.time_s.front();
  for (std::size_t k = 0; k < std::min(stretches.size(), of_wires.named); ++k)
    times += fmt::format("{}{:.0f} to {:.0f} s", k == 0 ? "" : ", ", pack.time_s[p.row[stretches[k].begin]] - start_s,
                         pack.time_s[p.row[stretches[k].end - 1]] - start_s);
  if (stretches.size() > of_wires.named) times += fmt::format(" and {} more times", stretches.size() - of_wires.named);
  f.because = fmt::format("Its contact is intermittent: bad in {:.1f} % of the rows, from {}. The rows are left out.",
                          100 * static_cast<double>(sizes.size()) / static_cast<double>(pack.rows()), times);
  return f;
}

}  // namespace

std::vector<LooseWire> take_loose_wires(PackRecording& pack, double quiet_a) {
  std::vector<LooseWire> wires;
  for (std::size_t c = 0; c + 1 < pack.cells() && pack.cells() > 2; ++c) {
    const Pair p = pair_of(pack, c);
    if (p.row.size() < of_wires.least_rows) continue;
    const Levels levels = levels_of(p, quiet_a);
    if (levels.leaps == 0) continue;
    const double usual_v = usual_level(levels);
    std::vector<char> bad;
    std::vector<double> off_v;
    for (const double v : levels.of_row_v) {
      off_v.push_back(v - usual_v);
      bad.push_back(std::abs(v - usual_v) > levels.leap_v / 2 ? 1 : 0);
    }
    const auto rows = static_cast<std::size_t>(std::count(bad.begin(), bad.end(), 1));
    if (rows < (levels.leaps == 1 ? of_wires.rows_of_one_leap : of_wires.rows)) continue;
    wires.push_back({c, rows, finding_of(pack, p, c, off_v, bad)});
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
