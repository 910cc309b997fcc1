// The page of a diagnosis: what it is, where, how much, before and after, why, what remains; then the curves.
#pragma once

#include <string>

#include "workflow/diagnosis_result.hpp"

namespace bms::reports {

std::string diagnosis_report(const workflow::DiagnoseResult& result);

}  // namespace bms::reports
