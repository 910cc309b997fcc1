// The result of a diagnosis.
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/healthy_coverage.hpp"
#include "diagnosis/healthy_null.hpp"
#include "diagnosis/hypothesis.hpp"
#include "diagnosis/law_term.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/recording_check.hpp"
#include "diagnosis/thresholds.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

enum class Verdict { no_mismatch, cause, causes, ambiguous, unknown, data_fault, not_testable, unfinished };
const char* name_of(Verdict verdict);

/// Whether the verdict names mechanisms.
inline bool names(Verdict verdict) {
  return verdict == Verdict::cause || verdict == Verdict::causes || verdict == Verdict::ambiguous;
}

/// A range of one axis in which most of the mismatch lies.
struct Regime {
  std::string axis;  ///< "soc", "current_c", "temperature_c", "since_edge_s"
  double from = 0, to = 0;
  double share = 0;  ///< of the mismatch's energy
  double usual = 0;  ///< share of the time that the recordings spend there
};

/// A resistance with its standard deviation.
struct UncertainOhm {
  double ohm = 0, std_ohm = 0;
};

/// A resistance at two temperatures, the mean over the steps of the current weighted by their squares.
struct ResistanceAt {
  std::string name;
  UncertainOhm here;                      ///< at the temperature of the recordings
  std::optional<UncertainOhm> reference;  ///< at that of the cell file; nothing: no law says how it follows
};

/// Resistances at the temperature of the recordings, where they are known best (resistances.hpp).
struct CellResistances {
  double temperature_c = 0;        ///< as read, the mean weighted by the squared current
  double reference_c = 0;          ///< of the cell file
  double step_s = 0;               ///< median distance of two rows: of the resistance "step_ohm"
  std::vector<ResistanceAt> cell;  ///< of the cell with the findings
};

/// A hypothesis with the values found, and the covariance of its estimated parameters.
struct Fitted {
  Hypothesis hypothesis;
  Eigen::MatrixXd covariance;
};

struct Finding {
  MechanismSetting setting;    ///< values and standard deviations
  std::vector<char> at_bound;  ///< by parameter
  double probability = 0;
  std::vector<std::size_t> equivalent_to;  ///< catalogue indices that these recordings cannot distinguish from it
  std::vector<Fitted> rivals;              ///< all findings, with each of equivalent_to in its place
  double gain = 0;                         ///< cost without it less cost with it
  double rms_contribution_v = 0;           ///< RMS change of the voltage by it [V]
  std::string because;                     ///< why this one and not a rival
  std::vector<ResistanceAt> resistances;   ///< its own, and what it adds to R0 and R1; empty without a temperature
};

/// A set of mechanisms that was fitted, and how well.
struct Ranked {
  std::vector<std::size_t> ids;
  double probability = 0, gain = 0, explained_share = 0;
};

struct DetectionLimit {
  std::size_t mechanism = 0;
  std::size_t parameter = 0;
  double value = 0;  ///< in the parameter's unit
};

/// Which causes could be distinguished if one of them were there (isolability.hpp).
struct Isolability {
  std::vector<DetectionLimit> causes;        ///< and the sizes at which they are compared
  std::vector<std::vector<double>> gain;     ///< [a][b]: by which these recordings would prefer a to b if a were there
  std::vector<std::vector<bool>> separable;  ///< by cause and cause: enough, whichever of the two is there
  /// What separates a pair: second_voltmeter, second_ammeter or the name of an experiment. Empty: these recordings do,
  /// or nothing that was tried.
  std::vector<std::vector<std::string>> separated_by;
};
inline constexpr const char *second_voltmeter = "second_voltmeter", *second_ammeter = "second_ammeter";

/// Strength of a mechanism that was not found, in its parameter's unit. Faint changes of one recording become a trend
/// over many.
struct ChangeEstimate {
  std::size_t mechanism = 0;
  double value = 0;  ///< to first order around the result, base parameters marginalised; may lie beyond its bounds
  double std = 0;    ///< includes the tolerance of the cell file; above 0
};

struct NotTestable {
  std::size_t mechanism = 0;
  std::string reason;
};

/// Gain of one mechanism, >= 0: the largest gain that it had when it was added or taken away.
struct MechanismGain {
  std::size_t mechanism = 0;
  double gain = 0;
};

/// What would have been named without healthy recordings to compare with.
struct Withheld {
  std::size_t mechanism = no_mechanism;  ///< no_mechanism: an unknown cause
  MechanismSetting setting;              ///< values and standard deviations; of a mechanism
  double gain = 0;
  HealthyComparison healthy;
  bool not_covered = false;  ///< the recordings go where the healthy ones did not
  /// All that speaks for it lies here, and there are no healthy recordings.
  std::optional<model::Span> only_place = std::nullopt;
};

/// The healthy data of a cell file.
struct HealthyBasis {
  double hours = 0;
  std::size_t recordings = 0, blocks = 0;
  double false_alarm_rate = 0;
  HealthyCoverage covered = {1, 1, {}};
  bool decided = true;  ///< what may be named (healthy_decide); otherwise the answer is as without them, and
                        ///< false_alarm_rate was not applied
};

/// For plots, one value per row.
struct RecordingView {
  std::vector<double> base_v, extended_v, soc;
};

struct Diagnosis {
  Verdict verdict = Verdict::not_testable;
  std::string statement;                      ///< what is wrong, how sure, what to do next
  std::vector<model::Span> spans;             ///< of the first record
  std::vector<Regime> regimes;                ///< the sharpest first
  bool interrupted = false;                   ///< Options::stopped: the verdict is `unfinished`, and nothing is named
  std::vector<std::size_t> tried, not_tried;  ///< then: mechanisms that were fitted, and those that were not
  double explained_share = 0;
  std::vector<Finding> findings;   ///< the largest gain first
  std::vector<Ranked> candidates;  ///< the largest gain first
  double noise_floor_v = 0;
  double unexplained_rmse_v = 0, unexplained_share = 0;
  std::vector<DetectionLimit> limits;
  std::optional<Isolability> isolability;  ///< nothing: the recordings can test nothing, or healthy data are learned
  std::vector<ChangeEstimate> estimates;   ///< of what a technician can judge
  std::optional<CellResistances> resistances;  ///< nothing: without a temperature, or of a cell that is not understood
  std::vector<NotTestable> not_testable;
  std::vector<DataFault> faults;
  std::vector<std::string> warnings;
  std::vector<MechanismGain> gains;     ///< of all mechanisms with any; before anything was withheld
  double unknown_gain = 0;              ///< that something else is there, before anything was withheld
  std::optional<HealthyBasis> healthy;  ///< nothing: the cell file has none that can be compared
  std::vector<Withheld> withheld;       ///< the largest gain first
  std::optional<LawTerm> law;           ///< of an unknown cause
  Hypothesis extended;                  ///< the cell's own mechanisms and those found
  model::CellParameters<> cell;      ///< base parameters moved, within their tolerance, to where they fit together with
                                     ///< the findings, or with the term of an unknown cause; else as given. R1 of a
                                     ///< 1RC cell contains a part of a slow polarisation: mechanisms alone increased a
                                     ///< real hold-out error from 15 to 27 mV, with the base parameters they halve it
  Eigen::MatrixXd covariance;        ///< of the estimated parameters of `extended`
  NoiseModel noise;                  ///< nominal
  std::vector<RecordingView> views;  ///< by record
  // the numbers behind the verdict
  std::string remaining_goes_with;  ///< what the unexplained residual depends on, if there is much of it
  double base_cost = 0, best_cost = 0, remaining = 0, adequacy = 1, fast_excess = 0, far_out = 0;
};

/// Returns true if a recording goes where the healthy ones did not: nothing found there does not prove that nothing is
/// there, because the cell file's tolerance is all that is known of it. A file made at 20 degrees C has a tolerance of
/// 83 mV at 40 degrees C, where the cell's resistance is 19 % lower: nothing stood out. The error there, 47 mV, is no
/// larger than on healthy recordings at the same states of charge, so its size does not decide either. Without healthy
/// data the tolerance decides, and the limits say what would have been found.
inline bool goes_beyond_healthy(const Diagnosis& d) {
  return d.healthy && d.healthy->covered.least < thresholds.healthy.covered_at_least;
}

/// Returns true if nothing was named, and more healthy data would decide whether a cause is there.
inline bool more_healthy_data_would_decide(const Diagnosis& d) {
  const bool withheld = std::any_of(d.withheld.begin(), d.withheld.end(), [](const Withheld& w) {
    return w.healthy.hours_needed.has_value() || w.not_covered;
  });
  return d.findings.empty() && (withheld || goes_beyond_healthy(d));
}

}  // namespace bms::diagnosis
