#include "benchmark/truth/healthy_cells.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace bms::benchmark::truth {

namespace {

Curve tabulated(const plant::MonotoneCurve& curve) {
  return Curve([&](double soc) { return curve.at(soc); });
}

/// The plateaus of Table 9 with other heights.
Curve ocv_like_table9(plant::Random& random) {
  constexpr std::array rises_v = {0.335, 0.039, 0.032, 0.008, 0.0012, 0.004, 0.023, 0.009, 0.0012, 0.133};
  const double roundness = between(random, 0.1, 0.5);  // part of each line that its corners round off
  double knot_v = between(random, 2.82, 2.9);
  std::vector<plant::Point> points = {{0, knot_v}};
  for (std::size_t k = 0; k < rises_v.size(); ++k) {
    const double rise_v = rises_v[k] * std::exp((k == 0 || k == 9 ? 0.08 : 0.3) * random.normal()) + 0.0006;
    const double from = static_cast<double>(k) / 10;
    points.push_back({from + roundness / 10, knot_v + roundness * rise_v});
    if (roundness < 0.45) points.push_back({from + (1 - roundness) / 10, knot_v + (1 - roundness) * rise_v});
    knot_v += rise_v;
  }
  points.push_back({1, knot_v});
  return tabulated(plant::MonotoneCurve(std::move(points)));
}

/// Two plateaus: the stages of graphite against a flat positive electrode.
Curve ocv_of_stages(plant::Random& random) {
  const double plateau_v = between(random, 3.19, 3.21), slope_v = between(random, 0.006, 0.02);
  const double first_at = between(random, 0.24, 0.33), first_v = between(random, 0.03, 0.05),
               first_width = between(random, 0.04, 0.065);
  const double main_at = between(random, 0.6, 0.72), main_v = between(random, 0.026, 0.04),
               main_width = between(random, 0.016, 0.035);
  const double empty_v = between(random, 0.26, 0.36), empty_width = between(random, 0.024, 0.036);
  const double full_v = between(random, 0.1, 0.16), full_width = between(random, 0.013, 0.022);
  const auto stage = [](double soc, double at, double width) { return 1 / (1 + std::exp(-(soc - at) / width)); };
  return Curve([=](double soc) {
    const double z = std::fmin(std::fmax(soc, -0.02), 1.02);  // straight beyond the knees
    const double beyond = soc - z;
    const double empty = empty_v * std::exp(-z / empty_width), full = full_v * std::exp((z - 1) / full_width);
    return plateau_v + 0.025 + slope_v * z + first_v * stage(z, first_at, first_width) +
           main_v * stage(z, main_at, main_width) - empty + full +
           beyond * (beyond < 0 ? empty / empty_width : full / full_width);
  });
}

Curve over_soc(plant::Random& random, const std::array<double, 10>& table, double scale, double variation) {
  const SmoothRandom wave(random);
  const double lowest = std::exp(between(random, -0.05, 0.25));  // the table is flat below 10 %
  std::vector<plant::Point> points = {{0, scale * lowest * table[0]}};
  for (std::size_t k = 0; k < table.size(); ++k) {
    const double soc = static_cast<double>(k + 1) / 10;
    points.push_back({soc, scale * table[k] * std::exp(variation * wave.at(soc))});
  }
  const plant::MonotoneCurve curve(std::move(points));
  return Curve([&](double soc) { return curve.at(std::fmin(std::fmax(soc, 0), 1)); });
}

}  // namespace

HealthyCell draw_healthy_cell(plant::Random& random) {
  HealthyCell cell;
  cell.capacity_ah = std::round(10 * log_between(random, 2, 280)) / 10;
  const double size = cell.capacity_ah / 6;
  cell.ocv_v = chance(random, 0.5) ? ocv_like_table9(random) : ocv_of_stages(random);
  const double quality = std::exp(0.2 * random.normal());
  cell.r0_ohm = over_soc(
      random,
      {0.0140197, 0.013602, 0.0133872, 0.0132749, 0.013237, 0.0131549, 0.0131347, 0.0132971, 0.0135692, 0.0153566},
      quality * std::exp(0.15 * random.normal()) / size, 0.03);
  const double low_rise = between(random, 0.013, 0.027);
  cell.r1_ohm = over_soc(
      random,
      {low_rise, 0.012339, 0.00998571, 0.009014, 0.00825815, 0.00771709, 0.00740307, 0.00777491, 0.00822862, 0.0072376},
      quality * std::exp(0.15 * random.normal()) / size, 0.05);
  cell.c1_f =
      over_soc(random, {420.558, 833.847, 1109.31, 1249.35, 1399.3, 1473.69, 1526.64, 1509.14, 1445.43, 1927.32},
               std::clamp(size * std::exp(0.25 * random.normal()) / quality, 0.3, 43.0),
               0.05);  // range of a cell file: 100 to 100,000 F
  cell.thermal.heat_capacity_j_per_k *= size * std::exp(0.1 * random.normal());
  cell.thermal.to_ambient_w_per_k *= between(random, 1, 2.5) * std::cbrt(size * size);
  return cell;
}

}  // namespace bms::benchmark::truth
