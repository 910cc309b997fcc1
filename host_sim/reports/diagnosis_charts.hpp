// Voltages and errors over time, with the interval of the prediction, for the page of a diagnosis.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "workflow/diagnosis_result.hpp"

namespace bms::reports {

/// The value with so many decimals; null if it is not finite.
nlohmann::json rounded(double value, int decimals);

/// One entry for each recording, the hold-outs first. The hold-outs have the half width of the 95 % interval around the
/// extended cell's voltage, or the recordings if there is no hold-out.
nlohmann::json diagnosis_charts(const workflow::DiagnoseResult& r);

/// One sentence for each hold-out: how many of its readings are within the interval.
std::vector<std::string> interval_texts(const workflow::DiagnoseResult& r);

}  // namespace bms::reports
