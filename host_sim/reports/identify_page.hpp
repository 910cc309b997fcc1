// The page of bms identify.
#pragma once

#include <string>
#include <vector>

#include "workflow/recorded_pulses.hpp"

namespace bms::reports {

/// Parameters, goodness of fit and voltages, for the identification data and each validation recording.
std::string identify_report(const workflow::IdentifyResult& result,
                            const std::vector<workflow::RecordedPulses>& pulses);

}  // namespace bms::reports
