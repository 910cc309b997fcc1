// The experiment that an ambiguous diagnosis proposes, run on the concealed cell, and the diagnosis of all recordings
// together; then the next one, until no cause is ambiguous or no experiment would separate those that are.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "benchmark/truth/cases.hpp"
#include "diagnosis/diagnose.hpp"

namespace bms::benchmark {

/// One experiment and the diagnosis of all recordings so far.
struct Round {
  std::string profile;
  double expected_gain = 0, duration_s = 0, plan_wall_s = 0;
  diagnosis::Verdict verdict = diagnosis::Verdict::not_testable;
  /// For each finding: the finding and its rivals.
  std::vector<std::vector<std::string>> sets;
};

struct FollowUp {
  std::vector<Round> rounds;            ///< empty: no experiment was proposed
  bool separated = false;               ///< by the first: the true effect is named and no rival of the first diagnosis
  bool nothing_more = false;            ///< still ambiguous, and no other experiment would separate what is left
  bool decided_at_once = false;         ///< after the first experiment causes are named, and none has a rival
  bool right_at_once = false;           ///< and all of them are true
  bool decided = false, right = false;  ///< the same after the last
};

/// Empty unless the diagnosis is ambiguous. The answer is used only after the last diagnosis.
std::optional<FollowUp> follow_up(const truth::Case& c, const model::CellParameters<>& cell,
                                  const diagnosis::PreparedRecording& recording, const diagnosis::Diagnosis& first);

/// How it ended: "right", "WRONG", "nothing more can be learned", "still ambiguous", or a verdict that names nothing.
const char* end_of(const FollowUp& up);

/// For each finding: its id and the ids of its rivals.
std::vector<std::vector<std::string>> sets_of(const diagnosis::Diagnosis& d);

}  // namespace bms::benchmark
