#include "tests/host_sim/workflow/identify_trial.hpp"

#include <algorithm>
#include <cmath>

#include "experiments/experiment.hpp"
#include "workflow/identification_data.hpp"

namespace bms::workflow {

namespace {

namespace id = identification;

/// Cost and RMS error of the true circuit, where the identification looked for the best one.
void judge_objective(const plant::SimulatedCell& cell, const Trial& trial, const id::Identification& found,
                     const id::Data& data, TrialResult& result) {
  id::DataSet record;
  record.data = data;
  record.initial_soc = trial.from_soc;
  record.estimate_initial_v_rc = false;
  const id::GreyBox grey_box(found.cell, {record}, found.options);
  const id::LeastSquares problem = grey_box.problem();
  Eigen::VectorXd x = found.optimum.x, residuals;
  const auto nodes = static_cast<Eigen::Index>(found.options.soc_nodes.size());
  for (Eigen::Index k = 0; k < 3 * nodes; ++k) {
    const id::Unknown& unknown = grey_box.unknowns()[static_cast<std::size_t>(k)];
    x[k] = std::clamp(cell.truth(unknown.name(), unknown.soc), problem.lower[k], problem.upper[k]);
  }
  if (!problem.evaluate(x, residuals, nullptr)) return;
  const auto samples = static_cast<Eigen::Index>(data.size());
  result.cost = found.optimum.cost;
  result.truth_cost = 0.5 * residuals.squaredNorm();
  result.truth_rmse_v = std::sqrt(residuals.head(samples).squaredNorm() / static_cast<double>(samples));
}

/// The options of `bms identify` for a recording of this cell.
IdentifyOptions options_for(const plant::SimulatedCell& cell, const Trial& trial, const std::filesystem::path& folder) {
  IdentifyOptions options;
  options.recordings = {(folder / "recording.csv").string()};
  options.initial_soc.value = trial.from_soc;
  options.out = options.name = "trial";
  options.chemistry = cell.nmc ? "NMC" : "LFP";
  if (trial.ocv == OcvSource::rests) {
    options.ocv_from_rests = true;
    options.capacity_ah = cell.capacity_ah();
    return options;
  }
  for (const double direction : {-1.0, 1.0}) {
    if (direction > 0 && cell.half_gap_v == 0) continue;
    const auto file = folder / (direction < 0 ? "discharge.csv" : "charge.csv");
    plant::record(cell, plant::slow_profile(cell.capacity_ah(), direction), direction < 0 ? 1 : 0, 0, false, 1, file);
    options.ocv.push_back(file.string());
  }
  return options;
}

}  // namespace

std::vector<Trial> trials_of(const plant::SimulatedCell& cell) {
  const bool slow = cell.number % 2 == 0 || cell.nmc || cell.half_gap_v > 0;
  const OcvSource rests = slow ? OcvSource::slow_runs : OcvSource::rests;
  constexpr const char* pulses[] = {"rest_30s",        "rest_18s",         "rest_5s",
                                    "high_1m_low_30s", "high_30s_low_30s", "high_30s_low_1m"};
  std::vector<Trial> trials;
  for (std::size_t k = 0; k < cell.pulse_soc.size(); ++k)
    trials.push_back({pulses[k], cell.pulse_soc[k], 0, OcvSource::slow_runs});
  for (const char* name : {"ocv_10min_rest", "ocv_1h_rest"}) {
    trials.push_back({name, 1, 0, rests});
    trials.push_back({name, 1, 0.35, rests});
  }
  return trials;
}

TrialResult run_trial(const plant::SimulatedCell& cell, const Trial& trial, const std::filesystem::path& folder) {
  const auto profile = *experiments::experiment(trial.experiment, {.capacity_ah = cell.capacity_ah()});
  const plant::CoveredSoc covered =
      plant::record(cell, profile, trial.from_soc, trial.to_soc, true, 3'000 + static_cast<std::uint64_t>(cell.number),
                    folder / "recording.csv");
  const IdentifyResult found = identify_cell(options_for(cell, trial, folder));
  const id::Identification& identified = found.identification;
  TrialResult result;
  for (const id::Parameter& p : identified.parameters) {
    if (p.name == "ocv_lean") continue;
    constexpr double touched = 0.02;  // a node at the end of the range
    if (p.soc < covered.low - touched || p.soc > covered.high + touched) continue;
    if (p.at_bound || !p.identifiable)
      ++result.not_claimed;
    else
      result.judged.push_back({p.name, p.soc, p.value, p.std, cell.truth(p.name, p.soc)});
  }
  result.rmse_v = identified.estimation.rmse_v;
  for (const measurement::Warning& w : found.warnings) result.warnings.push_back(w.text);
  judge_objective(cell, trial, identified, found.data.front(), result);
  return result;
}

}  // namespace bms::workflow
