#include "benchmark/truth/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

namespace bms::benchmark::truth {

namespace {

constexpr int grid = 200;  // edges lie on multiples of 0.5 %

/// Splits where the straight line has its largest error, until that error is below `good` or there are `most` edges.
/// error(left, right, at): error at `at` of the line from left to right.
std::vector<double> place_edges(int first, std::size_t least, std::size_t most, double good,
                                const std::function<double(double, double, double)>& error) {
  std::vector<int> edges = {first, grid};
  const auto soc = [](int place) { return place / double{grid}; };
  while (edges.size() < most) {
    double worst = 0;
    int where = -1;
    for (std::size_t k = 0; k + 1 < edges.size(); ++k) {
      for (int at = edges[k] + 2; at <= edges[k + 1] - 2; ++at) {
        const double e = std::abs(error(soc(edges[k]), soc(edges[k + 1]), soc(at)));
        if (e > worst) {
          worst = e;
          where = at;
        }
      }
    }
    if (where < 0 || (worst < good && edges.size() >= least)) break;
    edges.insert(std::upper_bound(edges.begin(), edges.end(), where), where);
  }
  std::vector<double> socs;
  for (int place : edges) socs.push_back(soc(place));
  return socs;
}

double on_line(double left, double right, double at, double left_value, double right_value) {
  return left_value + (at - left) / (right - left) * (right_value - left_value);
}

/// Values at the edges whose connecting lines fit best between 2 % and 98 % SOC; weight: of each place.
std::vector<double> fit_lines(const std::vector<double>& edges, const std::function<double(double)>& value,
                              const std::function<double(double)>& weight) {
  const std::size_t n = edges.size();
  std::vector<double> diagonal(n, 0.0), off_diagonal(n, 0.0), right_side(n, 0.0);
  std::size_t k = 0;
  for (double soc = std::max(0.02, edges.front()); soc <= 0.98; soc += 0.001) {
    while (k + 2 < n && soc > edges[k + 1]) ++k;
    const double b = (soc - edges[k]) / (edges[k + 1] - edges[k]), a = 1 - b, w = weight(soc);
    diagonal[k] += w * a * a;
    diagonal[k + 1] += w * b * b;
    off_diagonal[k] += w * a * b;
    right_side[k] += w * a * value(soc);
    right_side[k + 1] += w * b * value(soc);
  }
  for (std::size_t e = 0; e < n; ++e) {  // a small weight on the curve itself, for the ends
    const double own = 0.5 * weight(edges[e]);
    diagonal[e] += own;
    right_side[e] += own * value(edges[e]);
  }
  for (std::size_t e = 1; e < n; ++e) {
    const double share = off_diagonal[e - 1] / diagonal[e - 1];
    diagonal[e] -= share * off_diagonal[e - 1];
    right_side[e] -= share * right_side[e - 1];
  }
  std::vector<double> values(n);
  for (std::size_t e = n; e-- > 0;)
    values[e] = (right_side[e] - (e + 1 < n ? off_diagonal[e] * values[e + 1] : 0)) / diagonal[e];
  return values;
}

}  // namespace

CalibratedCell calibrate(const HealthyCell& cell, double share, plant::Random& random) {
  CalibratedCell made;
  made.capacity_ah = cell.capacity_ah * (1 + 0.0025 * share * between(random, -1, 1));

  const Curve& ocv = cell.ocv_v;
  made.ocv_soc =
      place_edges(0, 10, 20, between(random, 0.0015, 0.003),  // the fit halves it
                  [&](double l, double r, double at) { return on_line(l, r, at, ocv.at(l), ocv.at(r)) - ocv.at(at); });
  const SmoothRandom ocv_error(random), r0_error(random), r1_error(random), c1_error(random);
  std::vector<double> edge_v = fit_lines(
      made.ocv_soc, [&](double soc) { return ocv.at(soc); }, [](double) { return 1.0; });
  for (std::size_t k = 0; k < edge_v.size(); ++k)
    edge_v[k] += share * made.ocv_tolerance_v * ocv_error.at(made.ocv_soc[k]);
  double left_v = edge_v[0];
  for (std::size_t k = 0; k + 1 < made.ocv_soc.size(); ++k) {
    const double left = made.ocv_soc[k], width = made.ocv_soc[k + 1] - left;
    const double right_v = std::max(edge_v[k + 1], left_v + 0.0005 * width);  // the OCV of a cell file rises
    made.ocv_b1_v.push_back((right_v - left_v) / width);
    made.ocv_b0_v.push_back(left_v - made.ocv_b1_v.back() * left);
    left_v = right_v;
  }

  made.rc_soc = place_edges(6, 6, 9 + below(random, 3), 0.012, [&](double l, double r, double at) {
    const auto off = [&](const Curve& curve) {
      return std::abs(on_line(l, r, at, curve.at(l), curve.at(r)) / curve.at(at) - 1);
    };
    return std::max({off(cell.r0_ohm), off(cell.r1_ohm), 0.6 * off(cell.c1_f)});
  });
  const auto fit = [&](const Curve& curve) {  // relative error
    return fit_lines(
        made.rc_soc, [&](double soc) { return curve.at(soc); },
        [&](double soc) { return 1 / (curve.at(soc) * curve.at(soc)); });
  };
  made.r0_ohm = fit(cell.r0_ohm);
  made.r1_ohm = fit(cell.r1_ohm);
  made.c1_f = fit(cell.c1_f);
  for (std::size_t k = 0; k < made.rc_soc.size(); ++k) {
    made.r0_ohm[k] *= 1 + share * made.resistance_tolerance * r0_error.at(made.rc_soc[k]);
    made.r1_ohm[k] *= 1 + share * made.resistance_tolerance * r1_error.at(made.rc_soc[k]);
    made.c1_f[k] *= 1 + share * std::clamp(0.03 * c1_error.at(made.rc_soc[k]), -0.05, 0.05);
  }
  return made;
}

}  // namespace bms::benchmark::truth
