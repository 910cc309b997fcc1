// The page of a diagnosis: cause, location, size, before and after, reason, unexplained residual; then the curves.
#pragma once

#include <string>

#include "workflow/diagnosis_result.hpp"

namespace bms::reports {

std::string diagnosis_report(const workflow::DiagnoseResult& result);

}  // namespace bms::reports
