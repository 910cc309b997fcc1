// The law on which an unknown cause acts, for the page of a diagnosis.
#pragma once

#include <nlohmann/json.hpp>

#include "workflow/diagnosis_result.hpp"

namespace bms::reports {

/// Name, what it depends on, errors on the parts that were left out, and the learned change of its table over the state
/// of charge; null if no law was named. Without a term the curve is empty.
nlohmann::json law_chart(const workflow::DiagnoseResult& r);

}  // namespace bms::reports
