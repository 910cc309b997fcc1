// The page of a depot, and its JSON: what to visit first and why, how the cells age, every recording.
#pragma once

#include <string>

#include "fleet/analysis.hpp"

namespace bms::reports {

/// to_depot: path from the page's folder to the depot's, for links to the pages of its recordings.
std::string fleet_report(const fleet::History& history, const fleet::Analysis& analysis,
                         const fleet::AnalysisOptions& options, const std::string& to_depot);

std::string json_of(const fleet::History& history, const fleet::Analysis& analysis,
                    const fleet::AnalysisOptions& options);

}  // namespace bms::reports
