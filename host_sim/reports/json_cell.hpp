// Results of the commands about a cell as JSON objects. Their names are relied on from outside.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "diagnosis/prediction_interval.hpp"
#include "files/cell_file.hpp"
#include "replay/simulation_result.hpp"
#include "workflow/diagnosis_result.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::reports {

/// Of bms cell.
std::string json_of(const files::CellFile& cell, const std::vector<std::string>& doubts);
/// coverage: of the measured voltage, if there is one and an interval.
std::string json_of(const replay::SimulationResult& result,
                    const std::optional<diagnosis::Coverage>& coverage = std::nullopt);
std::string json_of(const workflow::IdentifyResult& result);
std::string json_of(const workflow::DiagnoseResult& result);

}  // namespace bms::reports
