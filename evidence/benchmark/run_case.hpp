// Runs the diagnosis on one concealed case. The answer of the case is copied to the outcome after the diagnosis has
// ended.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "benchmark/follow_up.hpp"
#include "benchmark/truth/cases.hpp"
#include "diagnosis/diagnose.hpp"
#include "model/cell_parameters.hpp"

namespace bms::benchmark {

struct Outcome {
  std::string name;
  truth::Answer answer;
  diagnosis::Verdict verdict = diagnosis::Verdict::not_testable;
  std::vector<std::string> found;              ///< ids, most probable first
  std::vector<std::vector<std::string>> sets;  ///< for each finding: its id and its rivals
  double probability = 0;                      ///< of the first finding
  double overlap = 0;                          ///< of the located and the true time, intersection over union
  double holdout_before_v = 0, holdout_after_v = 0, holdout_floor_v = 0;
  std::string law;        ///< that an unknown cause acts on
  bool has_term = false;  ///< for that law, learned from the recording
  std::optional<diagnosis::Isolability> isolability;
  double wall_s = 0;
  std::optional<FollowUp> next;  ///< of an ambiguous diagnosis
  std::string figures;           ///< figures behind the decision, for the printed line
};

/// The cell file of a case, as the tool would read it.
model::CellParameters<> cell_of(const truth::CalibratedCell& cell);

diagnosis::PreparedRecording record_of(const truth::Series& s, double initial_soc, double sigma);

/// Copies the answer to the outcome and compares them. Called after the diagnosis has ended. spans: located times;
/// holdout_v: predicted voltage of each row of the hold-out, empty without a hold-out.
void compare(Outcome& o, const truth::Case& c, const std::vector<model::Span>& spans,
             const std::vector<double>& holdout_v);

/// The diagnosis of this project, of an ambiguous one also the experiments that it proposes.
Outcome run_case(const truth::Case& c, bool with_experiments);
inline Outcome run_case_with_experiments(const truth::Case& c) { return run_case(c, true); }
inline Outcome run_case_alone(const truth::Case& c) { return run_case(c, false); }

}  // namespace bms::benchmark
