// All results of a depot as one table, in SQLite and as CSV. Its bytes depend on the units and their results alone, not
// on the engine, the order or the number of runs.
//
// Each recording has one row of kind `verdict`, with its error if the tool refused it. Further rows, by task:
//
//   found      diagnose: a mechanism that was named; value and std of its first parameter, all of them in `settings`
//   estimate   diagnose: the strength of a mechanism that was not named
//   parameter  identify: an identified parameter; mechanism: "r0_ohm at 0.4"
//   figure     replay: soc.final, voltage.prediction_rmse_v, ...
#pragma once

#include <cstddef>
#include <map>
#include <string>

#include "fleet/depot.hpp"

namespace bms::fleet {

struct MergeCounts {
  std::size_t recordings = 0, errors = 0, missing = 0, rows = 0;
  std::map<std::string, std::size_t> verdicts;  ///< diagnose: how many recordings have each
};

/// Writes fleet.sqlite and fleet.csv, each completely or not at all. A unit without a result has the error "not run".
MergeCounts merge(const Depot& depot);

}  // namespace bms::fleet
