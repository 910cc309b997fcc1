// Which experiment would tell a finding from what these recordings cannot tell from it.
//
// T-optimal (Atkinson and Fedorov, Biometrika 62, 1975) in the metric of the diagnosis itself: every hypothesis of the
// set in turn is taken for the truth, its voltage and the readings beside trusted instruments are simulated, and each
// other one may move its own parameters as far as the recordings leave them open and the base parameters within their
// tolerance (one linear projection). What is left is the gain by which they would part. Of the designs that part all by
// decision::settled the shortest is chosen; if none does, the one that parts most.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/diagnose.hpp"
#include "experiments/experiment.hpp"

namespace bms::diagnosis {

struct NextExperiment {
  std::string profile;     ///< of experiments/
  double capacity_ah = 0;  ///< to lay it out for: what the cell may hold at least
  double start_soc = 0;
  double step_s = 1;  ///< to log it at, at most
  double duration_s = 0;
  std::vector<std::size_t> separates;  ///< catalogue indices, the finding's own first
  std::vector<std::size_t> leaves;     ///< of its set, those that even this would not tell from it
  double gain = 0;                     ///< by which the nearest two of `separates` are expected to part
};

/// For one of the findings. temperature: whether it is recorded. Nothing when it stands alone or no design parts it
/// from any other.
std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& diagnosis,
                                              const Finding& finding, bool temperature);

/// For the finding that is most in need of one: the strongest that does not stand alone.
std::optional<NextExperiment> next_experiment(const model::CellParameters<>& cell, const Diagnosis& diagnosis,
                                              bool temperature);

/// One sentence: "To tell A from B: pulses of ... (2:30 h)."
std::string why(const NextExperiment& next);
/// What to prepare and what to log.
std::string_view instruction(const NextExperiment& next);
/// The command line that writes the profile.
std::string command(const NextExperiment& next);

}  // namespace bms::diagnosis
