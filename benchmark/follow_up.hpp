// The experiment that an ambiguous diagnosis proposes, run on the concealed cell, and the diagnosis of both recordings
// together.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "benchmark/truth/cases.hpp"
#include "diagnosis/diagnose.hpp"

namespace bms::benchmark {

struct FollowUp {
  std::string profile;  ///< empty: no experiment was proposed
  double expected_gain = 0, duration_s = 0, plan_wall_s = 0;
  /// For each finding from both recordings: the finding and its rivals.
  std::vector<std::vector<std::string>> sets;
  bool separated = false;  ///< the true effect is named and no rival of the first diagnosis
};

/// Empty unless the diagnosis is ambiguous. The answer is used only after the second diagnosis.
std::optional<FollowUp> follow_up(const truth::Case& c, const model::CellParameters<>& cell,
                                  const diagnosis::PreparedRecording& recording, const diagnosis::Diagnosis& first);

/// For each finding: its id and the ids of its rivals.
std::vector<std::vector<std::string>> sets_of(const diagnosis::Diagnosis& d);

}  // namespace bms::benchmark
