// The report of an identification.
#pragma once

#include <string>
#include <vector>

#include "identification/data.hpp"
#include "reports/json_results.hpp"

namespace bms::reports {

/// Parameters, figures, and how the voltage is followed. recordings: the first that was identified from, then those
/// that validate.
std::string identify_report(const IdentifyResult& result, const std::vector<identification::Data>& recordings);

}  // namespace bms::reports
