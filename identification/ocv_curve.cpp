#include "identification/ocv_curve.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace bms::identification {

namespace {

constexpr int grid = 1000;  // steps of soc
const double unknown = std::numeric_limits<double>::quiet_NaN();

/// One run on the grid, NaN where it has not been; and the rested voltages before and after.
struct Run {
  std::vector<double> voltage_v = std::vector<double>(grid + 1, unknown);
  bool charges = false;
  double moved_ah = 0, rested_before_v = 0, rested_after_v = 0;
};

Run on_grid(const SlowRun& slow) {
  const Data& d = slow.data;
  if (d.size() < 100) throw std::invalid_argument("an OCV recording of less than 100 samples");
  double charged_as = 0, discharged_as = 0, largest_a = 0;
  for (std::size_t k = 1; k < d.size(); ++k) {
    const double as = d.current_a[k] * (d.time_s[k] - d.time_s[k - 1]);
    (as > 0 ? charged_as : discharged_as) += std::abs(as);
    largest_a = std::max(largest_a, std::abs(d.current_a[k]));
  }
  Run run;
  run.charges = charged_as > discharged_as;
  const double moved_as = std::max(charged_as, discharged_as);
  run.moved_ah = moved_as / 3'600;
  if (std::min(charged_as, discharged_as) > 0.01 * moved_as)
    throw std::invalid_argument("an OCV recording that both charges and discharges");
  if (largest_a > run.moved_ah / 8)
    throw std::invalid_argument("an OCV recording faster than C/8: its voltage is not an open-circuit voltage");

  std::vector<double> soc = slow.soc;
  if (soc.empty()) {
    double s = run.charges ? 0 : 1;
    for (std::size_t k = 0; k < d.size(); ++k) {
      if (k > 0) s += d.current_a[k] * (d.time_s[k] - d.time_s[k - 1]) / moved_as;
      soc.push_back(s);
    }
  }
  // the moving part, in order of soc; a grid point takes the mean of what the run says within half a step of it
  std::vector<double> sum(grid + 1, 0), weight(grid + 1, 0);
  std::size_t first = d.size(), last = 0;
  for (std::size_t k = 1; k < d.size(); ++k) {
    if (std::abs(d.current_a[k]) < 0.2 * largest_a || !std::isfinite(d.voltage_v[k])) continue;
    first = std::min(first, k);
    last = k;
    const double at = soc[k] * grid;
    if (!(at > -1 && at < grid + 1)) continue;
    const int below = static_cast<int>(std::floor(at));
    const double above_part = at - below;
    if (below >= 0)
      sum[static_cast<std::size_t>(below)] += (1 - above_part) * d.voltage_v[k],
          weight[static_cast<std::size_t>(below)] += 1 - above_part;
    if (below < grid)
      sum[static_cast<std::size_t>(below + 1)] += above_part * d.voltage_v[k],
          weight[static_cast<std::size_t>(below + 1)] += above_part;
  }
  const auto [lowest, highest] = std::minmax_element(soc.begin(), soc.end());
  if (first >= last || *highest - *lowest < 0.8)
    throw std::invalid_argument("an OCV recording of less than 80 % of the state of charge");
  std::size_t covered_from = grid + 1, covered_to = 0;
  for (std::size_t g = 0; g <= grid; ++g) {
    if (weight[g] < 0.2) continue;
    run.voltage_v[g] = sum[g] / weight[g];
    covered_from = std::min(covered_from, g);
    covered_to = g;
  }
  for (std::size_t g = covered_from, known = covered_from; g <= covered_to; ++g) {
    if (!std::isfinite(run.voltage_v[g])) continue;
    for (std::size_t j = known + 1; j < g; ++j) {
      run.voltage_v[j] = run.voltage_v[known] + (run.voltage_v[g] - run.voltage_v[known]) *
                                                    static_cast<double>(j - known) / static_cast<double>(g - known);
    }
    known = g;
  }
  run.rested_before_v = d.voltage_v[first - 1];
  run.rested_after_v = d.voltage_v.back();
  return run;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

/// Mean of the runs of one kind on the grid.
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

/// Rested voltage at full (or empty): the end of the runs that lead there, the start of those that come from there.
std::optional<double> rested(const std::vector<Run>& runs, bool full) {
  std::vector<double> values;
  for (const Run& run : runs) values.push_back(run.charges == full ? run.rested_after_v : run.rested_before_v);
  if (values.empty()) return std::nullopt;
  return mean_of(values);
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
  }
  curve.capacity_ah = mean_of(all);
  if (!charged.empty() && !discharged.empty()) curve.coulombic_efficiency = mean_of(discharged) / mean_of(charged);

  const auto up = averaged(runs, true), down = averaged(runs, false);
  const auto known = [](double v) { return std::isfinite(v); };
  // half the distance where both runs have been, carried on beyond
  std::vector<double> half(grid + 1, 0);
  std::size_t both_from = grid + 1, both_to = 0;
  for (std::size_t g = 0; g <= grid; ++g) {
    if (!known(up[g]) || !known(down[g])) continue;
    half[g] = (up[g] - down[g]) / 2;
    both_from = std::min(both_from, g);
    both_to = g;
  }
  for (std::size_t g = 0; both_from <= grid && g <= grid; ++g) half[g] = half[std::clamp(g, both_from, both_to)];
  std::vector<double> ocv(grid + 1, unknown);
  for (std::size_t g = 0; g <= grid; ++g) {
    if (known(up[g]) && known(down[g]))
      ocv[g] = (up[g] + down[g]) / 2;
    else if (known(up[g]))
      ocv[g] = up[g] - half[g];
    else if (known(down[g]))
      ocv[g] = down[g] + half[g];
  }
  // the last percent of either end bends into the cut-off under current: from there to what the cell rests at
  constexpr std::size_t bend = grid / 100;
  const auto anchor = [&](std::size_t from, std::size_t end, std::optional<double> rested_v) {
    if (!rested_v || !known(ocv[from])) return;
    const bool rising = end > from;
    const double end_v = rising ? std::max(*rested_v, ocv[from]) : std::min(*rested_v, ocv[from]);
    const double width = std::abs(static_cast<double>(end) - static_cast<double>(from));
    for (std::size_t k = 1; k <= static_cast<std::size_t>(width); ++k) {
      ocv[rising ? from + k : from - k] = ocv[from] + (end_v - ocv[from]) * static_cast<double>(k) / width;
    }
  };
  anchor(bend, 0, rested(runs, false));
  anchor(grid - bend, grid, rested(runs, true));
  for (std::size_t g = 0; g <= grid; ++g) {
    if (!known(ocv[g])) throw std::invalid_argument("OCV recordings that leave a part of the state of charge out");
  }
  curve.ocv_v = std::move(ocv);
  curve.half_gap_v = std::move(half);
  for (int g = 0; g <= grid; ++g) curve.soc.push_back(static_cast<double>(g) / grid);
  return curve;
}

std::optional<OcvPieces> fewest_pieces(const OcvCurve& curve, double error_v) {
  // Corners may lie at every grid point, at a few heights within the error. From each corner a fan of lines reaches as
  // far as some line stays within the error all the way (Imai and Iri, 1986); fewest pieces first, least squared error
  // second.
  constexpr std::array<double, 7> heights = {-0.9, -0.6, -0.3, 0, 0.3, 0.6, 0.9};  // of error_v
  constexpr double flattest = 1e-4;                                                // V per unit of soc
  constexpr std::size_t narrowest = 2;  // grid steps: a cell file asks for one at least
  constexpr double error_soc = 0.002;   // where the curve plunges, this far aside is near enough
  const std::size_t points = curve.soc.size(), levels = heights.size();
  std::vector<double> near_v(points, error_v);
  for (std::size_t k = 1; k + 1 < points; ++k)
    near_v[k] = std::max(error_v,
                         error_soc * (curve.ocv_v[k + 1] - curve.ocv_v[k - 1]) / (curve.soc[k + 1] - curve.soc[k - 1]));
  struct Best {
    int pieces = std::numeric_limits<int>::max();
    double squares = 0;
    std::size_t from = 0;
  };
  std::vector<Best> best(points * levels);
  const auto height = [&](std::size_t point, std::size_t level) {
    return curve.ocv_v[point] + heights[level] * near_v[point];
  };
  // sums over the curve, so that a piece's squared error costs no loop
  std::vector<double> sum_v(points + 1, 0), sum_vv(points + 1, 0), sum_vs(points + 1, 0), sum_s(points + 1, 0),
      sum_ss(points + 1, 0);
  for (std::size_t k = 0; k < points; ++k) {
    const double s = curve.soc[k], v = curve.ocv_v[k];
    sum_v[k + 1] = sum_v[k] + v;
    sum_vv[k + 1] = sum_vv[k] + v * v;
    sum_vs[k + 1] = sum_vs[k] + v * s;
    sum_s[k + 1] = sum_s[k] + s;
    sum_ss[k + 1] = sum_ss[k] + s * s;
  }
  const auto squares_of = [&](std::size_t from, std::size_t to, double offset, double slope) {
    const auto span = [&](const std::vector<double>& sum) { return sum[to + 1] - sum[from + 1]; };
    const double n = static_cast<double>(to - from);
    return std::max(0.0, span(sum_vv) - 2 * offset * span(sum_v) - 2 * slope * span(sum_vs) + n * offset * offset +
                             2 * offset * slope * span(sum_s) + slope * slope * span(sum_ss));
  };
  for (std::size_t level = 0; level < levels; ++level) best[level] = {0, 0, 0};
  for (std::size_t from = 0; from + narrowest < points + 1 && from < points; from += narrowest) {
    for (std::size_t level = 0; level < levels; ++level) {
      const Best& here = best[from * levels + level];
      if (here.pieces == std::numeric_limits<int>::max()) continue;
      double lowest = flattest, highest = std::numeric_limits<double>::infinity();
      for (std::size_t to = from + 1; to < points && lowest <= highest; ++to) {
        const double width = curve.soc[to] - curve.soc[from];
        lowest = std::max(lowest, (curve.ocv_v[to] - near_v[to] - height(from, level)) / width);
        highest = std::min(highest, (curve.ocv_v[to] + near_v[to] - height(from, level)) / width);
        if (to % narrowest != 0) continue;
        for (std::size_t end = 0; end < levels; ++end) {
          const double slope = (height(to, end) - height(from, level)) / width;
          if (slope < lowest || slope > highest) continue;
          const double squares =
              here.squares + squares_of(from, to, height(from, level) - slope * curve.soc[from], slope);
          Best& there = best[to * levels + end];
          if (here.pieces + 1 < there.pieces || (here.pieces + 1 == there.pieces && squares < there.squares))
            there = {here.pieces + 1, squares, from * levels + level};
        }
      }
    }
  }
  const auto last = std::min_element(
      best.end() - static_cast<std::ptrdiff_t>(levels), best.end(),
      [](const Best& a, const Best& b) { return a.pieces != b.pieces ? a.pieces < b.pieces : a.squares < b.squares; });
  if (last->pieces == std::numeric_limits<int>::max()) return std::nullopt;
  OcvPieces pieces;
  for (auto at = static_cast<std::size_t>(last - best.begin());; at = best[at].from) {
    pieces.soc.push_back(curve.soc[at / levels]);
    pieces.ocv_v.push_back(height(at / levels, at % levels));
    pieces.half_gap_v.push_back(curve.half_gap_v[at / levels]);
    if (at / levels == 0) break;
  }
  std::reverse(pieces.soc.begin(), pieces.soc.end());
  std::reverse(pieces.ocv_v.begin(), pieces.ocv_v.end());
  std::reverse(pieces.half_gap_v.begin(), pieces.half_gap_v.end());
  for (std::size_t k = 0, piece = 0; k < points; ++k) {
    while (piece + 2 < pieces.soc.size() && curve.soc[k] > pieces.soc[piece + 1]) ++piece;
    const double t = (curve.soc[k] - pieces.soc[piece]) / (pieces.soc[piece + 1] - pieces.soc[piece]);
    const double off_v =
        std::abs(pieces.ocv_v[piece] + t * (pieces.ocv_v[piece + 1] - pieces.ocv_v[piece]) - curve.ocv_v[k]);
    pieces.largest_error_v = std::max(pieces.largest_error_v, off_v * error_v / near_v[k]);
  }
  return pieces;
}

void add_gap_corners(OcvPieces& pieces, const OcvCurve& curve, double error_v, std::size_t most) {
  constexpr double lowest = 0.05, highest = 0.97;
  while (pieces.soc.size() < most) {
    // where it is off by most
    double largest_v = error_v;
    std::size_t worst = 0, before = 0;
    for (std::size_t k = 0, piece = 0; k < curve.soc.size(); ++k) {
      const double soc = curve.soc[k];
      while (piece + 2 < pieces.soc.size() && soc > pieces.soc[piece + 1]) ++piece;
      if (soc < lowest || soc > highest) continue;
      const double from = pieces.soc[piece], to = pieces.soc[piece + 1], t = (soc - from) / (to - from);
      const double off_v =
          std::abs(pieces.half_gap_v[piece] + t * (pieces.half_gap_v[piece + 1] - pieces.half_gap_v[piece]) -
                   curve.half_gap_v[k]);
      constexpr double narrowest = 0.0025;
      if (off_v > largest_v && soc - from > narrowest && to - soc > narrowest)
        largest_v = off_v, worst = k, before = piece;
    }
    if (worst == 0) return;
    const double t = (curve.soc[worst] - pieces.soc[before]) / (pieces.soc[before + 1] - pieces.soc[before]);
    const auto here = static_cast<std::ptrdiff_t>(before + 1);
    pieces.ocv_v.insert(pieces.ocv_v.begin() + here,
                        pieces.ocv_v[before] + t * (pieces.ocv_v[before + 1] - pieces.ocv_v[before]));
    pieces.half_gap_v.insert(pieces.half_gap_v.begin() + here, curve.half_gap_v[worst]);
    pieces.soc.insert(pieces.soc.begin() + here, curve.soc[worst]);
  }
}

}  // namespace bms::identification
