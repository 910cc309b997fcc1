// What recordings can show: the smallest effects, and which causes they can distinguish. For the page of a
// diagnosis, and as JSON.
#pragma once

#include <nlohmann/json.hpp>

#include "diagnosis/verdict.hpp"
#include "workflow/diagnosis_result.hpp"

namespace bms::reports {

/// Names, sizes in words and over the largest possible one, the smallest first.
nlohmann::json limits_chart(const workflow::DiagnoseResult& r);

/// Ids, sizes, matrices of pairs: gain, separable, what would separate them; all empty if nothing can be tested.
nlohmann::ordered_json isolability_json(const diagnosis::Diagnosis& d);

/// Names with sizes, what would separate pairs in words, and for each pair its place among these: -1 these recordings,
/// null nothing. Null if there is no pair.
nlohmann::json isolability_chart(const diagnosis::Diagnosis& d);

}  // namespace bms::reports
