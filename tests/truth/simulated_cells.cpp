#include "tests/truth/simulated_cells.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>

#include <fmt/format.h>

#include "plant/random.hpp"

namespace bms::plant {

namespace {

constexpr double ambient_c = 25, table9_ah = 6;
constexpr double voltage_noise_v = 0.0005, current_noise_c = 0.001;

/// Open-circuit voltage of an NMC cell, as data sheets show it.
MonotoneCurve nmc_ocv_v(Random& random) {
  const double curved_v = 0.03 * random.normal();
  std::vector<Point> points;
  constexpr double volts[] = {3.00, 3.35, 3.48, 3.56, 3.61, 3.66, 3.74, 3.84, 3.93, 4.03, 4.18};
  for (int k = 0; k <= 10; ++k) {
    const double soc = k / 10.0;
    points.push_back({soc, volts[k] + curved_v * soc * (1 - soc)});
  }
  return MonotoneCurve(std::move(points));
}

/// A curve of Table 9 for a cell of another size: the level differs by a third, and from tenth to tenth by a part of
/// what neighbours in Table 9 differ.
MonotoneCurve drawn(const MonotoneCurve& table9, double scale, double neighbours_differ, Random& random) {
  double bend = 0.3 * random.normal();
  std::vector<Point> points;
  for (int k = 0; k <= 11; ++k) {
    const double soc = k / 10.0;
    points.push_back({soc, scale * table9.at(soc) * std::exp(bend)});
    if (k > 0 && k < 10) bend += 0.5 * neighbours_differ * random.normal();
  }
  return MonotoneCurve(std::move(points));
}

MonotoneCurve scaled(const MonotoneCurve& curve, double by) {
  std::vector<Point> points;
  for (int k = 0; k <= 44; ++k) points.push_back({k / 40.0, by * curve.at(k / 40.0)});
  return MonotoneCurve(std::move(points));
}

/// The branch of a hysteresis: -1 after discharge, 1 after charge.
struct Branch {
  double position = -1, half_gap_v = 0, capacity_ah = 1;

  double next_v(double current_a, double duration_s) {
    constexpr double turns = 40;  // a fortieth of the capacity turns it
    const double target = current_a > 0 ? 1 : -1;
    position = target + (position - target) * std::exp(-turns * std::abs(current_a) * duration_s / 3'600 / capacity_ah);
    return half_gap_v * position;
  }
};

}  // namespace

SimulatedCell simulated_cell(int number, std::uint64_t family) {
  Random random(1'000 * family + static_cast<std::uint64_t>(number));
  constexpr double smallest_ah = 2, largest_ah = 400;
  SimulatedCell cell;
  cell.number = number;
  cell.nmc = number % 10 >= 7;
  if (number % 13 == 5) cell.half_gap_v = 0.005 + 0.007 * random.uniform();
  CellParameters& p = cell.parameters;
  p.capacity_ah = smallest_ah * std::pow(largest_ah / smallest_ah, random.uniform());
  p.step_s = 0.25;
  if (cell.nmc) p.ocv_v = nmc_ocv_v(random);
  const CircuitCurves table9 = table9_circuit();
  const double size = p.capacity_ah / table9_ah;
  p.circuit.r0_ohm = drawn(table9.r0_ohm, 1 / size, 0.044, random);
  p.circuit.r1_ohm = drawn(table9.r1_ohm, 1 / size, 0.28, random);
  p.circuit.c1_f = drawn(table9.c1_f, size, 0.27, random);
  Random starts(2'000 * family + static_cast<std::uint64_t>(number));
  for (double& soc : cell.pulse_soc) soc = 0.25 + 0.65 * starts.uniform();
  return cell;
}

SimulatedCell table9_of(double capacity_ah) {
  SimulatedCell cell;
  cell.parameters.capacity_ah = capacity_ah;
  cell.parameters.step_s = 0.25;
  const CircuitCurves table9 = table9_circuit();
  const double size = capacity_ah / table9_ah;
  cell.parameters.circuit = {scaled(table9.r0_ohm, 1 / size), scaled(table9.r1_ohm, 1 / size),
                             scaled(table9.c1_f, size)};
  return cell;
}

double SimulatedCell::truth(const std::string& name, double soc) const {
  if (name == "r0_ohm") return parameters.circuit.r0_ohm.at(soc);
  return (name == "r1_ohm" ? parameters.circuit.r1_ohm : parameters.circuit.c1_f).at(soc);
}

CoveredSoc record(const SimulatedCell& of, const std::vector<bms::experiments::ProfileRow>& profile, double from_soc,
                  double stop_soc, bool noisy, std::uint64_t seed, const std::filesystem::path& file) {
  Cell cell(of.parameters, {from_soc, 0, ambient_c});
  Random random(seed);
  Branch branch{from_soc > 0.5 ? 1.0 : -1.0, of.half_gap_v, of.parameters.capacity_ah};
  std::ofstream out(file);
  out << "time_s,current_a,voltage_v,temperature_c\n";
  CoveredSoc covered;
  double before_s = profile.front().time_s;
  for (const experiments::ProfileRow& row : profile) {
    const double duration_s = row.time_s - before_s;
    before_s = row.time_s;
    if (duration_s > 0) cell.run(row.current_a, ambient_c, duration_s);
    const double hysteresis_v = branch.next_v(row.current_a, duration_s);
    const double voltage_v = cell.voltage_v() + hysteresis_v + (noisy ? voltage_noise_v * random.normal() : 0);
    const double current_a =
        row.current_a +
        (noisy && row.current_a != 0 ? current_noise_c * of.parameters.capacity_ah * random.normal() : 0);
    out << fmt::format("{},{:.6f},{:.6f},{}\n", row.time_s, current_a, voltage_v, ambient_c);
    covered.low = std::min(covered.low, cell.soc());
    covered.high = std::max(covered.high, cell.soc());
    if (stop_soc > 0 && cell.soc() < stop_soc && row.current_a == 0) break;
  }
  return covered;
}

std::vector<bms::experiments::ProfileRow> slow_profile(double capacity_ah, double direction) {
  constexpr double c_rate = 0.05, step_s = 20, rest_s = 3'600;
  const double run_s = 3'600 / c_rate;
  std::vector<bms::experiments::ProfileRow> rows;
  for (double time_s = 0; time_s <= 2 * rest_s + run_s; time_s += step_s) {
    const bool runs = time_s > rest_s && time_s <= rest_s + run_s;
    rows.push_back({time_s, runs ? direction * c_rate * capacity_ah : 0});
  }
  return rows;
}

}  // namespace bms::plant
