// When a loose contact was open: stretches in which the residual goes with the current, and only in them.
//
// A burst of some seconds is short against what the slow parts of the noise remember, so it is looked for in the
// whitened residual, against the whitened current of every stretch. Stretches that seem to have less resistance are the
// control: a contact cannot.
#pragma once

#include <vector>

#include "diagnosis/noise.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "model/mechanisms/contact_intermittent.hpp"

namespace bms::diagnosis {

/// residual_v: measured less predicted, V, a value per row. found_ohm: added in a burst. None: nothing that chance
/// would not do.
std::vector<model::Span> find_bursts(const PreparedRecording& record, const std::vector<double>& residual_v,
                                     const Whitener& whitener, double& found_ohm);

}  // namespace bms::diagnosis
