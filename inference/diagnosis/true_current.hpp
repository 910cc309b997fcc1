// Recordings as they are with the current sensor's error taken away. Whether healthy recordings were at the same
// currents and states of charge is a question about the cell: a sensor that reads a third too much must not put its
// recording where no healthy one was.
#pragma once

#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/prepared_recording.hpp"

namespace bms::diagnosis {

/// With the gain and the zero of the current sensor that a fit has added, from the start that it has found.
std::vector<PreparedRecording> with_true_current(const LikelihoodModel& likelihood, const HypothesisFit& fit);

/// The same for the single instrument fault that explains the recordings best; as they read if none explains enough.
std::vector<PreparedRecording> with_likeliest_current(LikelihoodModel likelihood);

}  // namespace bms::diagnosis
