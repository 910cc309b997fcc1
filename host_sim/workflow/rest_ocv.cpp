#include "workflow/rest_ocv.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>

#include "model/ocv_voltage.hpp"

namespace bms::workflow {

namespace {

constexpr double shortest_rest_s = 600;  ///< ten minutes: what is left of the relaxation is a few millivolts
constexpr double rest_c_rate = 0.005;
constexpr std::size_t fewest_points = 4;
constexpr double least_range = 0.4, same_soc = 0.01;
constexpr double least_slope_v = 0.002;  ///< per unit of soc; a plateau rises at least so

/// Points at nearly the same state of charge become one, because a rest after a charge and one after a discharge differ
/// by the hysteresis.
std::vector<RestedPoint> merged(std::vector<RestedPoint> points) {
  std::sort(points.begin(), points.end(), [](const auto& a, const auto& b) { return a.soc < b.soc; });
  std::vector<RestedPoint> out;
  std::vector<int> count;
  for (const RestedPoint& p : points) {
    if (!out.empty() && p.soc - out.back().soc < same_soc) {
      const int n = ++count.back();
      out.back().soc += (p.soc - out.back().soc) / n;
      out.back().voltage_v += (p.voltage_v - out.back().voltage_v) / n;
    } else {
      out.push_back(p);
      count.push_back(1);
    }
  }
  return out;
}

/// The points above the curve.
std::vector<double> shifts(const std::vector<RestedPoint>& points, const model::OcvTable<double>& ocv) {
  std::vector<double> shift;
  for (const RestedPoint& p : points)
    shift.push_back(p.voltage_v - model::ocv_voltage(ocv, std::clamp(p.soc, 0.0, 1.0)));
  return shift;
}

/// Linear between the points, constant beyond them.
double between(const std::vector<RestedPoint>& points, const std::vector<double>& shift, double soc) {
  if (soc <= points.front().soc) return shift.front();
  if (soc >= points.back().soc) return shift.back();
  std::size_t k = 0;
  while (points[k + 1].soc < soc) ++k;
  return shift[k] + (soc - points[k].soc) / (points[k + 1].soc - points[k].soc) * (shift[k + 1] - shift[k]);
}

}  // namespace

std::vector<RestedPoint> rested_points(const measurement::Recording& r, double initial_soc, double capacity_ah) {
  std::vector<RestedPoint> points;
  double soc = initial_soc, begin_s = r.time_s.front();
  bool rests = false, at_start = false;
  for (std::size_t k = 0; k < r.rows(); ++k) {
    const double a = std::isfinite(r.current_a[k]) ? r.current_a[k] : 0;
    if (k > 0) soc += a * (r.time_s[k] - r.time_s[k - 1]) / 3'600 / capacity_ah;
    const bool now = std::abs(a) < rest_c_rate * capacity_ah;
    if (now && !rests) {
      begin_s = r.time_s[k > 0 ? k - 1 : 0];  // the current of a row is that of the interval that ends there
      at_start = k == 0;
    }
    rests = now;
    const bool ends = k + 1 == r.rows() || !(std::abs(r.current_a[k + 1]) < rest_c_rate * capacity_ah);
    if (!rests || !ends || !std::isfinite(r.voltage_v[k])) continue;
    // the first rest may follow anything, so its length does not matter
    if (r.time_s[k] - begin_s >= shortest_rest_s || (at_start && k > 0))
      points.push_back({soc, r.voltage_v[k], r.time_s[k] - begin_s});
  }
  return points;
}

RestedOcv move_ocv_to(std::vector<RestedPoint> all, files::CellFile& cell) {
  std::erase_if(all, [](const RestedPoint& p) { return p.soc < -0.02 || p.soc > 1.02; });
  const std::vector<RestedPoint> points = merged(std::move(all));
  if (points.size() < fewest_points || points.back().soc - points.front().soc < least_range) {
    throw std::invalid_argument(fmt::format(
        "{} of ten minutes or more at different states of charge, expected {} over {:.0f} % or more, "
        "or a slow charge or discharge with --ocv",
        points.size() == 1 ? "1 rest" : fmt::format("{} rests", points.size()), fewest_points, 100 * least_range));
  }
  model::OcvTable<double>& ocv = cell.parameters.ocv;
  const model::OcvTable<double> before = ocv;
  const std::vector<double> shift = shifts(points, before);
  RestedOcv result{points.size(), std::max(0.0, points.front().soc), std::min(1.0, points.back().soc), 0};
  for (std::size_t k = 1; k + 1 < points.size(); ++k) {
    const double part = (points[k].soc - points[k - 1].soc) / (points[k + 1].soc - points[k - 1].soc);
    const double predicted_v = shift[k - 1] + part * (shift[k + 1] - shift[k - 1]);
    result.error_v = std::max(result.error_v, std::abs(shift[k] - predicted_v));
  }
  // a knee of the curve may lie anywhere between two rests
  double widest = 0;
  for (std::size_t k = 1; k < points.size(); ++k) widest = std::max(widest, points[k].soc - points[k - 1].soc);
  double& axis = cell.parameters.tolerance.initial_soc;
  axis = std::max(axis, std::min(widest, 1.0) / std::sqrt(12));
  // edges: those of the start cell, and the points
  std::vector<double> edges(before.soc.value.begin(), before.soc.value.begin() + static_cast<long>(before.soc.size));
  for (const RestedPoint& p : points) {
    const bool near = std::any_of(edges.begin(), edges.end(), [&](double e) { return std::abs(e - p.soc) < same_soc; });
    if (!near && p.soc > 0 && p.soc < 1 && edges.size() < model::max_ocv_edges) edges.push_back(p.soc);
  }
  std::sort(edges.begin(), edges.end());
  std::vector<double> volts;
  for (const double soc : edges) volts.push_back(model::ocv_voltage(before, soc) + between(points, shift, soc));
  for (std::size_t k = 1; k < edges.size(); ++k)  // noise on a plateau must not make it fall
    volts[k] = std::max(volts[k], volts[k - 1] + least_slope_v * (edges[k] - edges[k - 1]));
  ocv = {};
  for (std::size_t k = 0; k < edges.size(); ++k) {
    ocv.soc.push_back(edges[k]);
    if (k == 0) continue;
    const double b1_v = (volts[k] - volts[k - 1]) / (edges[k] - edges[k - 1]);
    ocv.b0_v.push_back(volts[k] - b1_v * edges[k]);
    ocv.b1_v.push_back(b1_v);
  }
  return result;
}

}  // namespace bms::workflow
