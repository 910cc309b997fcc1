#include "identification/variance_parts.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "measurement/statistics.hpp"
#include "model/cell_parameters.hpp"

namespace bms::identification {

namespace {

/// Weighted sums of the least squares over x = by^2 and y = rms^2.
struct Sums {
  double one = 0, x = 0, xx = 0, y = 0, xy = 0;
};

Sums sums_of(std::span<const double> rms, std::span<const double> by, double constant, double per) {
  Sums s;
  for (std::size_t k = 0; k < rms.size(); ++k) {
    const double x = by[k] * by[k], y = rms[k] * rms[k];
    const double expected = std::max(constant + per * x, 1e-12), weight = 1 / (expected * expected);
    s.one += weight;
    s.x += weight * x;
    s.xx += weight * x * x;
    s.y += weight * y;
    s.xy += weight * x * y;
  }
  return s;
}

}  // namespace

VarianceParts variance_parts(std::span<const double> rms, std::span<const double> by) {
  if (rms.empty()) return {};
  double mean = 0;
  for (const double e : rms) mean += e * e / static_cast<double>(rms.size());
  double constant = mean, per = 0;
  constexpr int rounds = 100;  // scoring: least squares with the weights of the last solution
  for (int round = 0; round < rounds; ++round) {
    const Sums s = sums_of(rms, by, constant, per);
    const double determinant = s.one * s.xx - s.x * s.x;
    if (!(determinant > 1e-9 * s.one * s.xx)) return {std::sqrt(mean), 0};
    constant = (s.xx * s.y - s.x * s.xy) / determinant;
    per = (s.one * s.xy - s.x * s.y) / determinant;
    if (per < 0) {
      per = 0;
      constant = s.y / s.one;
    }
    if (constant < 0) {
      constant = 0;
      per = s.xy / s.xx;
    }
  }
  return {std::sqrt(constant), std::sqrt(per)};
}

std::vector<double> by_edge(std::span<const GrowthAt> outside) {
  std::vector<double> edges;
  if (outside.empty()) return edges;
  constexpr double near_k = 5;  // as in by_temperature()
  const auto [coldest, hottest] = std::ranges::minmax(outside, {}, &GrowthAt::temperature_c);
  const bool one = hottest.temperature_c - coldest.temperature_c <= near_k;
  const double middle_c = (coldest.temperature_c + hottest.temperature_c) / 2;
  measurement::MeanSquare colder, hotter;
  for (const GrowthAt& g : outside) (one || g.temperature_c < middle_c ? colder : hotter).add(g.per_ev);
  for (const measurement::MeanSquare& edge : {colder, hotter}) {
    if (edge.count() > 0) edges.push_back(edge.root());
  }
  return edges;
}

double growth_outside(std::span<const double> per_ev) {
  return per_ev.empty() ? 0 : std::hypot(model::default_resistance_per_ev, measurement::rms(per_ev));
}

}  // namespace bms::identification
