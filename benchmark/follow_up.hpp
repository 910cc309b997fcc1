// The experiment that an undecided diagnosis asks for, run on the concealed cell, and the diagnosis of both recordings
// together.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "benchmark/truth/cases.hpp"
#include "diagnosis/diagnose.hpp"

namespace bms::benchmark {

struct FollowUp {
  std::string profile;  ///< empty: none was named
  double expected_gain = 0, duration_s = 0, plan_wall_s = 0;
  std::vector<std::vector<std::string>> sets;  ///< of both recordings: each finding and what cannot be told from it
  bool separated = false;  ///< the truth is named, and nothing of what the first diagnosis confused it with
};

/// Nothing unless the diagnosis is ambiguous. The answer is looked at when all is done.
std::optional<FollowUp> follow_up(const truth::Case& c, const model::CellParameters<>& cell,
                                  const diagnosis::PreparedRecording& recording, const diagnosis::Diagnosis& first);

}  // namespace bms::benchmark
