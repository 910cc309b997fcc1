// The page of a diagnosis: what it is, where, how much, before and after, why, what remains; then the curves.
#pragma once

#include <string>

#include "host_sim/diagnosis_result.hpp"

namespace bms {

std::string diagnosis_report(const DiagnoseResult& result);

}  // namespace bms
