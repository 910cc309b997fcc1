// Results of simulation, identification and diagnosis as JSON objects. Their names are relied on from outside.
#pragma once

#include <optional>
#include <string>

#include "diagnosis/prediction_interval.hpp"
#include "host_sim/simulation_result.hpp"
#include "workflow/diagnosis_result.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::reports {

/// coverage: of the measured voltage, if there is one and an interval.
std::string json_of(const host_sim::SimulationResult& result,
                    const std::optional<diagnosis::Coverage>& coverage = std::nullopt);
std::string json_of(const workflow::IdentifyResult& result);
std::string json_of(const workflow::DiagnoseResult& result);

}  // namespace bms::reports
