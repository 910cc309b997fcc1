// The page of a depot, and its JSON: what to visit first and why, how the cells age, every recording.
#pragma once

#include <string>

#include "fleet/analysis.hpp"

namespace bms::reports {

/// One line for an issue: where, what, in how many recordings and since when.
std::string statement(const fleet::History& history, const fleet::Issue& issue);

/// to_depot: path from the page's folder to the depot's, for links to the pages of its recordings.
std::string fleet_report(const fleet::History& history, const fleet::Analysis& analysis, const std::string& to_depot);

std::string json_of(const fleet::History& history, const fleet::Analysis& analysis);

}  // namespace bms::reports
