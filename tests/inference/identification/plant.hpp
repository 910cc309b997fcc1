// Profiles through the cell of evidence/plant/, and readings with noise.
#pragma once

#include <random>
#include <span>
#include <vector>

#include "experiments/experiment.hpp"
#include "identification/data.hpp"
#include "plant/truth_cell.hpp"

namespace bms::identification {

struct PlantRun {
  Data data;  ///< without noise
  double soc_min = 1, soc_max = 0;
  std::vector<double> soc;
};

inline PlantRun run_plant(std::span<const experiments::ProfileRow> profile, double initial_soc,
                          const plant::CellParameters& parameters = {}) {
  constexpr double ambient_c = 20;
  plant::Cell cell(parameters, {initial_soc, 0, ambient_c});
  PlantRun run;
  run.data.capacity_ah = parameters.capacity_ah;
  double before_s = profile.front().time_s;
  for (const experiments::ProfileRow& row : profile) {
    if (row.time_s > before_s) cell.run(row.current_a, ambient_c, row.time_s - before_s);
    before_s = row.time_s;
    run.data.time_s.edit().push_back(row.time_s);
    run.data.current_a.edit().push_back(row.current_a);
    run.data.voltage_v.edit().push_back(cell.voltage_v());
    run.soc.push_back(cell.soc());
    run.soc_min = std::min(run.soc_min, cell.soc());
    run.soc_max = std::max(run.soc_max, cell.soc());
  }
  return run;
}

/// White noise on both readings.
inline Data noisy(Data data, std::mt19937_64& random, double voltage_v = 0.001, double current_a = 0.010) {
  std::normal_distribution<double> normal;
  for (double& v : data.voltage_v.edit()) v += voltage_v * normal(random);
  for (double& i : data.current_a.edit()) i += current_a * normal(random);
  return data;
}

}  // namespace bms::identification
