// Identifications by the path of `bms identify`, from files, of cells whose truth is known. Nothing of the truth comes
// from model/.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/truth/simulated_cells.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::workflow {

enum class OcvSource { slow_runs, rests };

struct Trial {
  std::string experiment;
  double from_soc = 1;
  double to_soc = 0;  ///< the recording ends when it is reached; 0: the whole experiment
  OcvSource ocv = OcvSource::slow_runs;
};

/// The trials of a cell: the seven experiments of the paper and rests of ten minutes, to empty and partial.
std::vector<Trial> trials_of(const plant::SimulatedCell& cell);

/// An identified value and the truth at the same state of charge.
struct Judged {
  std::string name;
  double soc = 0, value = 0, std = 0, truth = 0;
  double sigmas() const { return (value - truth) / std; }
  double relative() const { return value / truth - 1; }
};

struct TrialResult {
  std::vector<Judged> judged;           ///< what was identified, at nodes that the recording visits
  std::size_t not_claimed = 0;          ///< values at a bound or not seen
  double rmse_v = 0, truth_rmse_v = 0;  ///< of the fit; of the true circuit with the same OCV
  double cost = 0, truth_cost = 0;      ///< of the objective that was minimised
  std::vector<std::string> warnings;
};

/// Runs a trial. folder: for its files.
TrialResult run_trial(const plant::SimulatedCell& cell, const Trial& trial, const std::filesystem::path& folder);

}  // namespace bms::workflow
