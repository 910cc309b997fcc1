// The report of an identification.
#pragma once

#include <string>
#include <vector>

#include "host_sim/json_results.hpp"
#include "identification/data.hpp"

namespace bms {

/// Parameters, figures, and how the voltage is followed. recordings: the first that was identified from, then those that validate.
std::string identify_report(const IdentifyResult& result, const std::vector<identification::Data>& recordings);

}  // namespace bms
