// Which parts of the circuit a cell needs, decided on recordings that the fit has not seen.
//
// Candidates are fitted to all recordings but those of one temperature, which they then predict; with fewer
// temperatures one recording is left out, or the second half of each. Two candidates are compared by the logarithm of
// their RMSE, left-out part by left-out part, so that the coldest does not outweigh the others. Of the candidates
// within one standard error of the best, the one with the fewest unknowns is chosen (Breiman et al., Classification and
// Regression Trees, 1984).
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "identification/joint_fit.hpp"

namespace bms::identification {

struct JointCandidate {
  std::string name;  ///< of the physics, for the user
  JointModel model;
  int rc_pairs = 1;
};

/// One and two RC pairs, activation energies that differ, and resistances that rise towards empty in the cold. With
/// recordings at a single temperature only the pairs. cell: its [rc] is the start. mechanisms: hysteresis and its
/// temperature dependence. Ordered by the number of unknowns.
std::vector<JointCandidate> joint_candidates(const model::CellParameters<>& cell,
                                             const std::vector<model::MechanismSetting>& mechanisms,
                                             std::span<const JointRecording> recordings);

/// Mean of the recorded temperatures; nothing if none was recorded.
std::optional<double> mean_temperature_c(const JointRecording& recording);

/// Recordings within 5 K of each other, the coldest first. A single group if a temperature is missing.
std::vector<std::vector<std::size_t>> by_temperature(std::span<const JointRecording> recordings);

/// How a recording was predicted that was not in the fit.
struct LeftOutError {
  std::string name;
  std::optional<double> temperature_c;
  double rmse_v = 0;
  double resistance_error = 0;  ///< relative error of the modelled overpotential
  double soc_error = 0;         ///< error of the SOC axis
  double rest_v = 0;            ///< RMS of what is neither of the two
  double overpotential_v = 0;   ///< RMS of the modelled one
  double correlation_s = 0;     ///< over which that rest is correlated
  double beyond_per_ev = 0;     ///< distance in 1 / (k T) to the temperatures of the fit [1/eV]; 0: between them
};

struct CandidateResult {
  std::string name;
  std::size_t unknowns = 0;
  double fitted_rmse_v = 0;             ///< over the recordings of the fit
  std::vector<double> left_out_rmse_v;  ///< by left-out part
  double left_out_v = 0;                ///< geometric mean of the parts
  bool chosen = false;
};

/// The errors of the model that an estimator should expect, from left-out recordings.
struct ModelErrors {
  double resistance_fraction = 0;  ///< between the temperatures of the recordings
  double resistance_per_ev = 0;    ///< more of it per distance in 1 / (k T) outside
  double initial_soc = 0, model_v = 0, correlation_s = 0;
};

/// Where the recordings of a fit have been: rows whose voltage counts.
struct IdentifiedExtent {
  std::optional<double> temperature_min_c, temperature_max_c;
  double soc_min = 1, soc_max = 0;
  double current_max_a = 0;  ///< either sign
  double duration_s = 0;     ///< of the longest recording
};

struct StructureChoice {
  std::string left_out;            ///< what a part is: "temperature", "recording", "second half"
  std::vector<std::string> parts;  ///< names of the left-out parts
  std::vector<CandidateResult> candidates;
  std::size_t chosen = 0;
  JointModel model;                     ///< of the chosen candidate, at its fit
  JointFit fit;                         ///< of the chosen candidate to all recordings
  std::vector<LeftOutError> left_outs;  ///< of the chosen candidate
  ModelErrors errors;
  IdentifiedExtent extent;
};

/// Throws as fit_joint() does.
StructureChoice choose_structure(const std::vector<JointCandidate>& candidates,
                                 std::span<const JointRecording> recordings, const JointOptions& options);

/// The chosen circuit fitted to other recordings, from where it was; the errors to expect are those of `choice`. Throws
/// as fit_joint() does.
StructureChoice fitted_again(const StructureChoice& choice, std::span<const JointRecording> recordings,
                             const JointOptions& options);

/// Error of a prediction, separated by least squares. model: at its fit.
LeftOutError left_out_error(const JointModel& model, const JointRecording& recording, const RecordingState& state);

}  // namespace bms::identification
