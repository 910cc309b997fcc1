// The page of bms identify.
#pragma once

#include <string>

#include "workflow/identify_cell.hpp"

namespace bms::reports {

/// Parameters, goodness of fit and voltages, for the identification data and each validation recording.
std::string identify_report(const workflow::IdentifyResult& result);

}  // namespace bms::reports
