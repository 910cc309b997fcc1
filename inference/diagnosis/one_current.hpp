// Causes that a recording with a load of one current cannot distinguish.
//
// At a single current I the voltage is OCV(z0 - I t / C) - I R(t). An error of the current's reading, whatever its law,
// is a constant there: it acts as another capacity together with another resistance, and each of these follows the
// other within the tolerance of the cell file. Which of them fits best depends on errors of the model alone: an offset
// of 0.54 A in a discharge of a real cell was named a change of capacity. A resistance alone does not act so: it moves
// no knee, so it equals only what fits as well.
#pragma once

#include <span>
#include <vector>

#include "diagnosis/findings.hpp"
#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Of the largest current, by which a loaded row differs here from the reading in rests.
inline constexpr double loaded_at_one_current = 0.3;

/// Of the largest current, below which a reading may be that of a rest. An offset of a third of the load reads half as
/// much in a rest as under load.
inline constexpr double rest_at_one_current = 0.5;

/// Returns true if nearly all load has one current in one direction, switched on or off only a few times.
bool has_one_current(std::span<const PreparedRecording> records, double capacity_ah);

/// Adds to each finding of `best` those causes that equal it if the recordings have one current, each fitted in its
/// place. healthy_gain: as in findings_of().
void add_alike_at_one_current(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& best,
                              const HealthyGain& healthy_gain, std::vector<Finding>& findings);

}  // namespace bms::diagnosis
