#include "benchmark/truth/parallel_cells.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace bms::benchmark::truth {

namespace {

struct Half {
  double capacity_as, resistance_factor, soc, v1_v = 0;
};

/// Currents of both halves and the common terminal voltage.
struct Shared {
  std::array<double, 2> current_a;
  double terminal_v;
};

/// The resistances are chosen so that both halves together have those of the cell.
std::array<Half, 2> halves_of(const HealthyCell& cell, const Parallel& parallel, double start_soc) {
  const double d = parallel.inequality, whole_as = 3'600 * cell.capacity_ah;
  const double a = std::pow(1 + d, parallel.resistance_exponent), b = std::pow(1 - d, parallel.resistance_exponent);
  const double both = a * b / (a + b);
  return {{{whole_as * (1 + d) / 2, a / both, start_soc}, {whole_as * (1 - d) / 2, b / both, start_soc}}};
}

Shared share(const HealthyCell& cell, const std::array<Half, 2>& halves, double current_a) {
  std::array<double, 2> open_v{}, r0{};
  for (std::size_t n = 0; n < 2; ++n) {
    open_v[n] = cell.ocv_v.at(halves[n].soc) + halves[n].v1_v;
    r0[n] = cell.r0_ohm.at(halves[n].soc) * halves[n].resistance_factor;
  }
  const double terminal_v = (current_a + open_v[0] / r0[0] + open_v[1] / r0[1]) / (1 / r0[0] + 1 / r0[1]);
  return {{(terminal_v - open_v[0]) / r0[0], (terminal_v - open_v[1]) / r0[1]}, terminal_v};
}

void advance(const HealthyCell& cell, double current_a, double duration_s, Half& half) {
  const double r1 = cell.r1_ohm.at(half.soc) * half.resistance_factor;
  const double c1 = cell.c1_f.at(half.soc) / half.resistance_factor;
  half.v1_v = r1 * current_a + (half.v1_v - r1 * current_a) * std::exp(-duration_s / (r1 * c1));
  half.soc += current_a * duration_s / half.capacity_as;
}

}  // namespace

CellTrace run_parallel_cells(const HealthyCell& cell, const Parallel& parallel, const Stimulus& stimulus,
                             double start_soc) {
  const double whole_as = 3'600 * cell.capacity_ah;
  std::array<Half, 2> halves = halves_of(cell, parallel, start_soc);
  const int substeps = substeps_of(stimulus.step_s);
  const double h = stimulus.step_s / substeps;
  CellTrace trace;
  double temperature_c = stimulus.ambient_c.front();
  for (std::size_t k = 0; k < stimulus.current_a.size(); ++k) {
    const double current_a = stimulus.current_a[k];
    for (int s = 0; s < substeps && k > 0; ++s) {
      const Shared shared = share(cell, halves, current_a);
      for (std::size_t n = 0; n < 2; ++n) advance(cell, shared.current_a[n], h, halves[n]);
    }
    const double soc = (halves[0].soc * halves[0].capacity_as + halves[1].soc * halves[1].capacity_as) / whole_as;
    const double heat_w = current_a * current_a * (cell.r0_ohm.at(soc) + cell.r1_ohm.at(soc));
    const double lost_w = cell.thermal.to_ambient_w_per_k * (temperature_c - stimulus.ambient_c[k]);
    if (k > 0) temperature_c += stimulus.step_s / cell.thermal.heat_capacity_j_per_k * (heat_w - lost_w);
    trace.voltage_v.push_back(share(cell, halves, current_a).terminal_v);
    trace.soc.push_back(soc);
    trace.temperature_c.push_back(temperature_c);
    trace.v1_v.push_back((halves[0].v1_v + halves[1].v1_v) / 2);
  }
  return trace;
}

}  // namespace bms::benchmark::truth
