#include "identification/ocv_rest_test.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Dense>

#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

constexpr double rest_c_rate = 0.02;
constexpr double same_soc = 0.01;
constexpr double least_slope_v = 1e-5;  // per unit of SOC; a cell file needs a rising OCV
constexpr std::size_t fewest_rests = 3;

}  // namespace

std::vector<RestedVoltage> rested_voltages(const Data& data, double soc_from, double shortest_s) {
  std::vector<RestedVoltage> rests;
  double soc = soc_from, rested_s = 0, last_v = NAN;
  std::optional<bool> charging;
  const auto end_of_rest = [&] {
    if (rested_s >= shortest_s && std::isfinite(last_v)) {
      if (charging) rests.push_back({soc, last_v, *charging});
      for (const bool side : {false, true}) {
        if (!charging) rests.push_back({soc, last_v, side});
      }
    }
    rested_s = 0;
    last_v = NAN;
  };
  for (std::size_t k = 1; k < data.size(); ++k) {
    const double step_s = data.time_s[k] - data.time_s[k - 1], current_a = data.current_a[k];
    if (std::abs(current_a) < rest_c_rate * data.capacity_ah) {
      rested_s += step_s;
      if (std::isfinite(data.voltage_v[k])) last_v = data.voltage_v[k];
    } else {
      end_of_rest();
      charging = current_a > 0;
      soc += current_a * step_s / (3'600 * data.capacity_ah);
    }
  }
  end_of_rest();
  if (rests.size() < fewest_rests)
    throw std::invalid_argument("fewer than three rests, expected a test of pulses and rests");
  return rests;
}

double OcvPoints::at(double wanted) const {
  if (wanted <= soc.front()) return voltage_v.front();
  if (wanted >= soc.back()) return voltage_v.back();
  const auto above = static_cast<std::size_t>(std::upper_bound(soc.begin(), soc.end(), wanted) - soc.begin());
  const double part = (wanted - soc[above - 1]) / (soc[above] - soc[above - 1]);
  return voltage_v[above - 1] + part * (voltage_v[above] - voltage_v[above - 1]);
}

OcvPoints points_of(const std::vector<RestedVoltage>& rests, OcvDirection direction) {
  if (direction == OcvDirection::middle) {
    const OcvPoints down = points_of(rests, OcvDirection::discharge), up = points_of(rests, OcvDirection::charge);
    OcvPoints middle;
    for (const double soc : down.soc) {
      if (soc < up.soc.front() - same_soc || soc > up.soc.back() + same_soc) continue;
      middle.soc.push_back(soc);
      middle.voltage_v.push_back((down.at(soc) + up.at(soc)) / 2);
    }
    if (middle.soc.size() < 2) throw std::invalid_argument("no rests of both directions at the same state of charge");
    return middle;
  }
  std::vector<RestedVoltage> of_direction;
  for (const RestedVoltage& r : rests) {
    if (r.after_charge == (direction == OcvDirection::charge)) of_direction.push_back(r);
  }
  std::sort(of_direction.begin(), of_direction.end(), [](const auto& a, const auto& b) { return a.soc < b.soc; });
  OcvPoints points;
  for (const RestedVoltage& r : of_direction) {
    if (!points.soc.empty() && r.soc - points.soc.back() < same_soc / 10) continue;
    points.soc.push_back(r.soc);
    points.voltage_v.push_back(r.voltage_v);
  }
  if (points.soc.size() < 2) throw std::invalid_argument("fewer than two rests of this direction");
  return points;
}

model::OcvTable<double> even_pieces(const OcvPoints& points, std::size_t pieces) {
  model::OcvTable<double> table;
  const auto edge = [&](std::size_t k) { return static_cast<double>(k) / static_cast<double>(pieces); };
  double from_v = points.at(0);
  for (std::size_t k = 0; k <= pieces; ++k) {
    table.soc.push_back(edge(k));
    if (k == pieces) break;
    const double width = edge(k + 1) - edge(k);
    const double to_v = std::max(points.at(edge(k + 1)), from_v + least_slope_v * width);
    table.b1_v.push_back((to_v - from_v) / width);
    table.b0_v.push_back(from_v - table.b1_v[k] * edge(k));
    from_v = to_v;
  }
  return table;
}

std::vector<double> polynomial(const OcvPoints& points, std::size_t order) {
  const auto n = static_cast<Eigen::Index>(points.soc.size()), m = static_cast<Eigen::Index>(order + 1);
  Eigen::MatrixXd powers(n, m);
  for (Eigen::Index row = 0; row < n; ++row) {
    double power = 1;
    for (Eigen::Index k = 0; k < m; ++k) {
      powers(row, k) = power;
      power *= points.soc[static_cast<std::size_t>(row)];
    }
  }
  const Eigen::Map<const Eigen::VectorXd> v(points.voltage_v.data(), n);
  const Eigen::VectorXd x = numerics::solve_least_squares(powers, v);
  return {x.begin(), x.end()};
}

double polynomial_at(const std::vector<double>& c, double soc) {
  double v = 0;
  for (std::size_t k = c.size(); k-- > 0;) v = v * soc + c[k];
  return v;
}

}  // namespace bms::identification
