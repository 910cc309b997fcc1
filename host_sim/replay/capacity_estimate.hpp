// The cell's true capacity from one log, without a full cycle.
//
// Each stretch of the log gives an open-circuit voltage, V - R0 I - V_RC, and the charge counted so far. The capacity
// is what makes the state of charge of all of them agree with the cell file's OCV, wherever the log began:
//
//   chi2(C, soc0) = sum over stretches of ((ocv(soc0 + q / C) - u) / sigma)^2,  summed over soc0, normalised over C
//
// sigma of a stretch: hysteresis and the table's tolerance, and a third of the drop under current. A flat OCV shows
// nothing of C, and then there is no answer.
#pragma once

#include <optional>

#include "replay/replay.hpp"

namespace bms::replay {

/// Nothing if the log does not determine the capacity to 6 %, or if no capacity fits. Needs result.track and
/// result.prior.
std::optional<CapacityEstimate> estimate_capacity(const ReplayResult& result);

/// The cell file with the capacity that the charge is counted with, and its error where the filter can have one.
files::CellFile counted_cell(const ReplayResult& result);

/// Runs the estimator again with the estimated capacity, if that is another one than the cell file's
/// (capacity_differs), and evaluates result again. What the second run says of the capacity has to agree with the
/// first: an estimate that its own count does not confirm is not used. samples, start: as for the first run; result is
/// evaluated. Returns true if the charge is counted with the estimate now.
bool count_with_estimated_capacity(ReplayResult& result, const measurement::SampleList& samples,
                                   const std::optional<measurement::StartingPoint>& start);

/// Returns true if the estimate is another capacity than that of the cell file: by three sigma and 5 %.
bool capacity_differs(const ReplayResult& result);

/// A sentence for each kind of flag that a user can act on, with how often, the first time and the likely cause; and
/// one if the estimated capacity is not that of the cell file.
std::vector<std::string> reasons_of(const ReplayResult& result);

}  // namespace bms::replay
