// Which experiment would distinguish a finding from what these recordings cannot distinguish from it.
//
// T-optimal design (Atkinson and Fedorov, Biometrika 62, 1975) in the metric of the diagnosis itself. Each hypothesis
// of the set in turn is taken for the truth: its voltage and the readings of trusted instruments are simulated. Each
// other one may move its own parameters as far as the recordings leave them open, and the base parameters within their
// tolerance (one linear projection). What is left is the gain by which the two would be separated. Of the courses that
// separate all by Thresholds::Design::separates the shortest is chosen; if none does, the one that separates most.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "experiments/experiment.hpp"

namespace bms::diagnosis {

struct NextExperiment {
  std::string profile;     ///< of evidence/experiments/
  double capacity_ah = 0;  ///< for which to lay it out: what the cell holds at least
  double start_soc = 0;
  double step_s = 1;  ///< of the log, at most
  double duration_s = 0;
  std::vector<std::size_t> separates;  ///< catalogue indices, the finding's own first
  std::vector<std::size_t> leaves;     ///< of its set, those that even this would not distinguish from it
  double gain = 0;                     ///< smallest expected gain between the finding and the others of `separates`
};

/// For one finding. temperature: whether it is recorded. carried_out: names of courses that are among the recordings,
/// which are not proposed again: their repetition would show the same. Nothing if the finding has no rivals or no
/// other course separates it from any.
std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& diagnosis,
                                              const Finding& finding, bool temperature,
                                              const std::vector<std::string>& carried_out = {});

/// For the strongest finding that has rivals and a course to separate them.
std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& diagnosis,
                                              bool temperature, const std::vector<std::string>& carried_out = {});

/// One sentence: "To distinguish A from B: pulses of ... (2:30 h)."
std::string why(const NextExperiment& next);
/// What to prepare and what to log.
std::string_view instruction(const NextExperiment& next);
/// The command line that writes the profile.
std::string command(const NextExperiment& next);

}  // namespace bms::diagnosis
