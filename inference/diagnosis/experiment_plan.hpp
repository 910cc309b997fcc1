// An experiment as a recording that has not been made yet, and what instruments would read in it.
#pragma once

#include <utility>
#include <vector>

#include "diagnosis/mechanism.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "experiments/experiment.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// A course as a recording of which nothing has been read yet.
struct ExperimentPlan {
  PreparedRecording record;
  std::vector<experiments::ProfileRow> rows;
};

/// What is to be planned for.
struct PlanSetting {
  const model::CellParameters<>& cell;
  double capacity_ah;
  bool temperature;  ///< is recorded
};

ExperimentPlan planned(const experiments::Experiment& experiment, const PlanSetting& setting, double step_s);

/// Step of a course that is only simulated [s]: a coarse one is enough to choose by.
double coarse_step_s(const experiments::Experiment& experiment, double duration_s);
/// The noise of rows that stand for step_s readings.
NoiseModel of_coarse_rows(NoiseModel noise, double step_s);

/// Courses with a defined start and their durations [s], the shortest first.
std::vector<std::pair<double, const experiments::Experiment*>> courses(const PlanSetting& setting);

/// What the instruments of a cell with these mechanisms would read on a course, and trusted ones alongside. within: set
/// to false if the cell leaves its limits.
PreparedRecording read_under(const std::vector<MechanismSetting>& settings, const ExperimentPlan& plan,
                             const model::CellParameters<>& cell, bool& within);

}  // namespace bms::diagnosis
