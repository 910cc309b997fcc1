#include "plant/truth_cell.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace bms::plant {

MonotoneCurve table9_ocv_v() {
  // where neighbouring lines of Table 9 (b0 + b1 SOC) meet: 0 %, 10 % ... 100 %
  constexpr std::array knots_v = {2.871, 3.206, 3.245, 3.277, 3.285, 3.286, 3.290, 3.313, 3.322, 3.323, 3.456};
  std::vector<Point> points = {{0, knots_v.front()}};
  for (std::size_t k = 0; k + 1 < knots_v.size(); ++k) {
    // the middle of each line is fixed; the curve rounds the corners between the lines
    for (const double along : {0.1, 0.3, 0.7, 0.9}) {
      points.push_back({(static_cast<double>(k) + along) / 10, knots_v[k] + along * (knots_v[k + 1] - knots_v[k])});
    }
  }
  points.push_back({1, knots_v.back()});
  return MonotoneCurve(std::move(points));
}

namespace {

MonotoneCurve over_soc(const std::array<double, 10>& values) {
  std::vector<Point> points = {{0, values.front()}};
  for (std::size_t k = 0; k < values.size(); ++k) points.push_back({static_cast<double>(k + 1) / 10, values[k]});
  points.push_back({1.1, values.back()});
  return MonotoneCurve(std::move(points));
}

}  // namespace

CircuitCurves table9_circuit() {
  return {
      .r0_ohm = over_soc(
          {0.0140197, 0.013602, 0.0133872, 0.0132749, 0.013237, 0.0131549, 0.0131347, 0.0132971, 0.0135692, 0.0153566}),
      .r1_ohm = over_soc({0.027101, 0.012339, 0.00998571, 0.009014, 0.00825815, 0.00771709, 0.00740307, 0.00777491,
                          0.00822862, 0.0072376}),
      .c1_f = over_soc({420.558, 833.847, 1109.31, 1249.35, 1399.3, 1473.69, 1526.64, 1509.14, 1445.43, 1927.32}),
  };
}

TemperatureFactors lfp_in_the_cold() {
  constexpr std::array temperature_c = {-30, -20, -10, 0, 10, 20, 25, 35, 45};
  constexpr std::array r0 = {16.5, 7.22, 3.59, 2.08, 1.40, 1.09, 1.0, 0.890, 0.832};
  constexpr std::array r1 = {14.0, 7.97, 4.73, 2.91, 1.86, 1.22, 1.0, 0.685, 0.480};
  constexpr std::array c1 = {0.267, 0.354, 0.460, 0.586, 0.733, 0.905, 1.0, 1.208, 1.443};
  const auto curve = [&](const std::array<double, temperature_c.size()>& factors) {
    std::vector<Point> points;
    for (std::size_t k = 0; k < factors.size(); ++k)
      points.push_back({static_cast<double>(temperature_c[k]), factors[k]});
    return MonotoneCurve(std::move(points));
  };
  return {.r0 = curve(r0), .r1 = curve(r1), .c1 = curve(c1)};
}

Cell::Cell(CellParameters parameters, CellState start)
    : parameters_(std::move(parameters)), start_soc_(start.soc), dynamic_{start.v_rc_v, start.temperature_c} {}

double Cell::soc_at(double more_as) const {
  return start_soc_ + (charge_as_ + (more_as - lost_as_)) / (3'600 * parameters_.capacity_ah);
}

Cell::Circuit Cell::circuit_at(double soc, double temperature_c) const {
  const CircuitCurves& circuit = parameters_.circuit;
  Circuit at{circuit.r0_ohm.at(soc), circuit.r1_ohm.at(soc), circuit.c1_f.at(soc)};
  if (const auto& factors = parameters_.over_temperature) {
    at.r0_ohm *= factors->r0.at(temperature_c);
    at.r1_ohm *= factors->r1.at(temperature_c);
    at.c1_f *= factors->c1.at(temperature_c);
  }
  return at;
}

Cell::DynamicState Cell::rates(const DynamicState& at, double soc, double current_a, double ambient_c) const {
  const Circuit circuit = circuit_at(soc, at.temperature_c);
  const double through_r1_a = at.v_rc_v / circuit.r1_ohm;
  const double heat_w = current_a * current_a * circuit.r0_ohm + at.v_rc_v * through_r1_a;
  const Thermal& thermal = parameters_.thermal;
  return {
      .v_rc_v = (current_a - through_r1_a) / circuit.c1_f,
      .temperature_c =
          (heat_w - thermal.to_ambient_w_per_k * (at.temperature_c - ambient_c)) / thermal.heat_capacity_j_per_k,
  };
}

void Cell::run(double current_a, double ambient_c, double duration_s) {
  const int steps = static_cast<int>(std::ceil(duration_s / parameters_.step_s - 1e-9));
  const double h = duration_s / steps;
  const auto moved = [](const DynamicState& from, const DynamicState& rate, double for_s) {
    return DynamicState{from.v_rc_v + for_s * rate.v_rc_v, from.temperature_c + for_s * rate.temperature_c};
  };
  for (int k = 0; k < steps; ++k) {
    const auto rates_after = [&](double s, const DynamicState& at) {
      return rates(at, soc_at(current_a * (k * h + s)), current_a, ambient_c);
    };
    const DynamicState k1 = rates_after(0, dynamic_);
    const DynamicState k2 = rates_after(h / 2, moved(dynamic_, k1, h / 2));
    const DynamicState k3 = rates_after(h / 2, moved(dynamic_, k2, h / 2));
    const DynamicState k4 = rates_after(h, moved(dynamic_, k3, h));
    dynamic_ = moved(moved(moved(moved(dynamic_, k1, h / 6), k2, h / 3), k3, h / 3), k4, h / 6);
  }
  const double added_as = current_a * duration_s - lost_as_, sum_as = charge_as_ + added_as;
  lost_as_ = (sum_as - charge_as_) - added_as;
  charge_as_ = sum_as;
  current_a_ = current_a;
}

double Cell::voltage_v() const {
  return parameters_.ocv_v.at(soc()) + dynamic_.v_rc_v + circuit_at(soc(), temperature_c()).r0_ohm * current_a_;
}

}  // namespace bms::plant
