// The diagnosis of a pack as JSON and as a page.
#pragma once

#include <string>

#include "workflow/pack_diagnosis.hpp"

namespace bms::reports {

std::string json_of(const workflow::PackResult& result);

/// Verdict, findings, what can be distinguished, and the differences of the cells over time.
std::string pack_report(const workflow::PackResult& result);

}  // namespace bms::reports
