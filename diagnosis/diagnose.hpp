// The whole chain: is the data to be trusted, does the cell file explain it, where not, which mechanism would, is that
// more than chance, what remains, and what would settle what is open. README.md tells the reasons; every threshold is
// in decision.hpp.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "diagnosis/hypothesis.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/screen.hpp"

namespace bms::diagnosis {

enum class Verdict { no_mismatch, cause, causes, ambiguous, unknown, data_fault, not_testable };
const char* name_of(Verdict verdict);

/// A stretch of one axis in which most of the mismatch lies.
struct Regime {
  std::string axis;  ///< "soc", "current_c", "temperature_c", "since_edge_s", "direction"
  double from = 0, to = 0;
  double share = 0;  ///< of the mismatch's energy
  double usual = 0;  ///< share of the time that is spent there
};

/// A hypothesis with the values found, and how well they are known together: the covariance of what is sought.
struct Fitted {
  Hypothesis hypothesis;
  Eigen::MatrixXd covariance;
};

struct Finding {
  MechanismSetting setting;    ///< value and deviation
  std::vector<char> at_bound;  ///< by parameter
  double probability = 0;
  std::vector<std::size_t> equivalent_to;  ///< catalogue indices that these recordings cannot tell from it
  std::vector<Fitted> rivals;              ///< all that was found, with each of equivalent_to in its place
  double gain = 0;                         ///< cost without it less with it
  double rms_contribution_v = 0;
  std::string because;  ///< why this and not its neighbour
};

/// A set of mechanisms that was fitted, and how well.
struct Ranked {
  std::vector<std::size_t> ids;
  double probability = 0, gain = 0, explained_share = 0;
};

struct DetectionLimit {
  std::size_t mechanism = 0;
  std::size_t parameter = 0;
  double value = 0;
};

struct NotTestable {
  std::size_t mechanism = 0;
  std::string reason;
};

struct RecordingView {  ///< for plots
  std::vector<double> base_v, extended_v, soc;
};

struct Diagnosis {
  Verdict verdict = Verdict::not_testable;
  std::string statement;
  std::vector<model::Span> spans;
  std::vector<Regime> regimes;
  double explained_share = 0;
  std::vector<Finding> findings;
  std::vector<Ranked> candidates;
  double noise_floor_v = 0;
  double unexplained_rmse_v = 0, unexplained_share = 0;
  std::vector<DetectionLimit> limits;
  std::vector<NotTestable> not_testable;
  std::vector<DataFault> faults;
  std::vector<std::string> warnings;
  Hypothesis extended;           ///< the cell's own mechanisms and those found
  model::CellParameters<> cell;  ///< its parameters moved, within their tolerance, to where they fit beside what was
                                 ///< found; as given when nothing was
  Eigen::MatrixXd covariance;    ///< of what is sought in it
  NoiseModel noise;              ///< nominal
  std::vector<RecordingView> views;  ///< of each record
  // what the decision was made from
  std::string remaining_goes_with;  ///< what remains, if much does: with the time, the soc, a period of its own
  double base_cost = 0, best_cost = 0, remaining = 0, adequacy = 1, fast_excess = 0, far_out = 0;
};

struct Options {
  std::size_t most_mechanisms = 6;
  std::function<void(double done, const std::string& what)> progress;  ///< done: 0..1
};

/// own: mechanisms of the cell file. Records as read; what cannot be used is taken out here.
Diagnosis diagnose(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& own,
                   std::vector<PreparedRecording> records, const Options& options = {});

/// What holds for a later recording of the same cell and instruments: a contact that has changed stays so, where bursts
/// fell and where the first recording began does not.
std::vector<MechanismSetting> later_recording(const Hypothesis& extended);

/// Whether the verdict names mechanisms.
inline bool names(Verdict verdict) {
  return verdict == Verdict::cause || verdict == Verdict::causes || verdict == Verdict::ambiguous;
}

/// Open loop from its initial soc: the voltage that would be read.
std::vector<double> predict(const model::CellParameters<>& cell, const std::vector<MechanismSetting>& settings,
                            const PreparedRecording& record, std::vector<double>* soc = nullptr);

}  // namespace bms::diagnosis
