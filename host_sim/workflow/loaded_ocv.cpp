#include "workflow/loaded_ocv.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <stdexcept>

#include "identification/ocv_pieces.hpp"
#include "measurement/statistics.hpp"

namespace bms::workflow {

namespace {

constexpr double step_c = 0.2, load_c = 0.05;  ///< [C] a step of the current, a load
constexpr double reach_soc = 0.1;  ///< before a step at less charge the resistance changes over so much: it rises near
                                   ///< empty alone
constexpr double resistance_share = 0.1;  ///< by which the resistance on the way differs from that of the steps: 8 % in
                                          ///< a cell with steps all the way (NASA B0025)
constexpr double least_loaded_range = 0.4;
constexpr int grid = 1000, bin = 10;    ///< points of the curve; in a bin the readings of one recording are averaged
constexpr double least_rise_v = 0.002;  ///< per unit of soc
constexpr double full_soc = 0.98;

struct AtSoc {
  double soc = 0, value = 0;
};

/// What one recording shows.
struct Shown {
  std::vector<AtSoc> resistances_ohm;  ///< by decreasing soc
  std::vector<AtSoc> loaded_v;         ///< voltage
  std::vector<double> loaded_a;        ///< current of the same rows
  std::optional<double> full_v;        ///< rested voltage of the full cell
};

Shown shown_by(const LoadedRecording& of, double capacity_ah) {
  const measurement::Recording& r = *of.recording;
  Shown shown;
  double soc = of.initial_soc;
  const auto at = [&](std::size_t k) { return std::isfinite(r.current_a[k]) ? r.current_a[k] : 0; };
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const double a = at(k);
    if (k > 0) soc += a * (r.time_s[k] - r.time_s[k - 1]) / (3'600 * capacity_ah);
    if (!std::isfinite(r.voltage_v[k])) continue;
    if (k == 0 && soc >= full_soc && std::abs(a) < load_c * capacity_ah) shown.full_v = r.voltage_v[k];
    const double step_a = k > 0 ? a - at(k - 1) : 0;
    if (std::abs(step_a) > step_c * capacity_ah) {
      const double ohm = (r.voltage_v[k] - r.voltage_v[k - 1]) / step_a;
      if (ohm > 0) shown.resistances_ohm.push_back({soc, ohm});
    }
    if (a > -load_c * capacity_ah) continue;
    shown.loaded_v.push_back({soc, r.voltage_v[k]});
    shown.loaded_a.push_back(a);
  }
  return shown;
}

/// Between two steps the resistance is that of the step at more charge, until shortly before the other one.
double resistance_at(const std::vector<AtSoc>& steps, double soc) {
  std::size_t next = 0;
  while (next < steps.size() && steps[next].soc >= soc) ++next;
  if (next == 0) return steps.front().value;
  if (next == steps.size()) return steps.back().value;
  const AtSoc &above = steps[next - 1], &below = steps[next];
  const double begin = std::min(above.soc, below.soc + reach_soc);
  if (soc >= begin) return above.value;
  return below.value + (soc - below.soc) / (begin - below.soc) * (above.value - below.value);
}

/// Means of one recording by bin.
std::map<int, double> binned(const Shown& s) {
  std::map<int, std::vector<double>> readings_v;
  for (std::size_t k = 0; k < s.loaded_v.size(); ++k) {
    const AtSoc& v = s.loaded_v[k];
    const double ocv_v = v.value - s.loaded_a[k] * resistance_at(s.resistances_ohm, v.soc);
    readings_v[static_cast<int>(std::floor(v.soc * grid / bin))].push_back(ocv_v);
  }
  if (s.full_v) readings_v[grid / bin] = {*s.full_v};
  std::map<int, double> means;
  for (const auto& [b, values] : readings_v) {
    if (b >= 0 && b <= grid / bin) means[b] = measurement::mean(values);
  }
  return means;
}

/// Straight between the bins' middles and beyond the outermost ones; never falling.
identification::OcvCurve curve_through(const std::map<int, double>& bins) {
  std::vector<AtSoc> points;
  for (const auto& [b, v] : bins) {
    const double soc = b == grid / bin ? 1 : (b + 0.5) * bin / grid;
    const double least_v = points.empty() ? v : points.back().value + least_rise_v * (soc - points.back().soc);
    points.push_back({soc, std::max(v, least_v)});
  }
  identification::OcvCurve curve;
  std::size_t above = 1;
  for (int g = 0; g <= grid; ++g) {
    const double soc = static_cast<double>(g) / grid;
    while (above + 1 < points.size() && points[above].soc < soc) ++above;
    const AtSoc &a = points[above - 1], &b = points[above];
    curve.soc.push_back(soc);
    curve.ocv_v.push_back(a.value + (soc - a.soc) / (b.soc - a.soc) * (b.value - a.value));
    curve.half_gap_v.push_back(0);
  }
  return curve;
}

void put(const identification::OcvCurve& curve, model::CellParameters<>& p) {
  std::optional<identification::OcvPieces> pieces;
  for (double error_v = 0.002; !pieces || pieces->soc.size() > model::max_ocv_edges; error_v *= 1.5) {
    if (error_v > 0.1) throw std::invalid_argument("the voltage under load does not fall with the charge taken out");
    pieces = identification::fewest_pieces(curve, error_v);
  }
  p.ocv = {};
  for (std::size_t k = 0; k < pieces->soc.size(); ++k) {
    p.ocv.soc.push_back(pieces->soc[k]);
    if (k == 0) continue;
    const double b1_v = (pieces->ocv_v[k] - pieces->ocv_v[k - 1]) / (pieces->soc[k] - pieces->soc[k - 1]);
    p.ocv.b0_v.push_back(pieces->ocv_v[k] - b1_v * pieces->soc[k]);
    p.ocv.b1_v.push_back(b1_v);
  }
}

}  // namespace

LoadedOcv take_ocv_from_load(const std::vector<LoadedRecording>& recordings, files::CellFile& cell) {
  std::map<int, std::vector<double>> by_bin;
  std::vector<double> resistances_ohm, loads_a;
  LoadedOcv found{.soc_min = 1};
  for (const LoadedRecording& of : recordings) {
    const Shown s = shown_by(of, cell.parameters.capacity_ah);
    if (s.resistances_ohm.empty() || s.loaded_v.empty()) continue;
    for (const AtSoc& r : s.resistances_ohm) resistances_ohm.push_back(r.value);
    for (const double a : s.loaded_a) loads_a.push_back(std::abs(a));
    found.soc_min = std::min(found.soc_min, s.loaded_v.back().soc);
    found.soc_max = std::max(found.soc_max, s.loaded_v.front().soc);
    for (const auto& [b, v] : binned(s)) by_bin[b].push_back(v);
  }
  if (resistances_ohm.empty())
    throw std::invalid_argument("no step of the current from rest to load, to see a resistance");
  if (found.soc_max - found.soc_min < least_loaded_range)
    throw std::invalid_argument("the load covers less than 40 % of the state of charge");
  found.steps = resistances_ohm.size();
  found.resistance_ohm = measurement::median(resistances_ohm);
  std::map<int, double> means;
  std::vector<double> half_spreads_v;  // of bins that several recordings have
  for (auto& [b, values] : by_bin) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    if (values.size() > 1) half_spreads_v.push_back((*high - *low) / 2);
    means[b] = measurement::median(values);
  }
  const double by_resistance_v = resistance_share * found.resistance_ohm * measurement::median(loads_a),
               spread_v = half_spreads_v.empty() ? 0 : measurement::median(half_spreads_v);
  found.error_v = std::hypot(by_resistance_v, spread_v);
  put(curve_through(means), cell.parameters);
  return found;
}

}  // namespace bms::workflow
