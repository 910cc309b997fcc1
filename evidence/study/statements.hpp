// The statements of the paper (paper/statements.csv) and whether they hold in a run.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "study/observations.hpp"

namespace bms::study {

struct Statement {
  std::string id, where, text, rule;
};

/// In the order of the paper.
const std::vector<Statement>& statements();

struct Verdict {
  std::optional<bool> holds;  ///< missing: not judged
  std::string why;            ///< what was observed, or why it is not judged
};

/// Throws std::out_of_range if no judge has this id.
Verdict judge(const std::string& id, const Observations& run);

/// Share of runs in which a statement holds, with the 95 % interval of Wilson.
struct Share {
  std::size_t holds = 0, judged = 0;
  double low = 0, high = 1;
};
Share share_of(std::size_t holds, std::size_t judged);

}  // namespace bms::study
