// Whether the estimates of a replay can be trusted as a whole. An estimator always returns a state of charge and a
// standard deviation, also if a recording contradicts itself or the cell file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "replay/replay.hpp"

namespace bms::replay {

struct Judgement {
  std::optional<std::string> impossible;  ///< what cannot be true, and its most likely cause
  std::vector<std::string> doubts;        ///< reasons why the state of charge is not reliable
};

/// Judges result.track by its flags and its range, and by the warnings of result.recording. Throws std::runtime_error
/// if an estimate is not a number, which is a fault of the estimator.
Judgement judge(const ReplayResult& result);

}  // namespace bms::replay
