// One concealed case through the diagnosis, and through simpler rules beside it. What the case's answer is stays in the
// answer: it is copied to the outcome after the diagnosis has ended.
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
  std::vector<std::string> found;              ///< most certain first
  std::vector<std::vector<std::string>> sets;  ///< of each: itself and what cannot be told from it
  double probability = 0;                      ///< of the first
  double overlap = 0;                          ///< of the located time and the true one, intersection over union
  double holdout_before_v = 0, holdout_after_v = 0, holdout_floor_v = 0;
  double wall_s = 0;
  std::optional<FollowUp> next;  ///< of an ambiguous one
  std::string figures;           ///< what the decision was made from, for a person
};

/// The cell file that a case comes with, as the tool would read it.
model::CellParameters<> cell_of(const truth::CalibratedCell& cell);

diagnosis::PreparedRecording record_of(const truth::Series& s, double initial_soc, double sigma);

/// Copies the answer and measures by it what was said; only when all has been said. spans: where; holdout_v: predicted
/// for the hold-out, row by row; empty: there is none.
void compare(Outcome& o, const truth::Case& c, const std::vector<model::Span>& spans,
             const std::vector<double>& holdout_v);

/// Our diagnosis.
Outcome run_case(const truth::Case& c);

}  // namespace bms::benchmark
