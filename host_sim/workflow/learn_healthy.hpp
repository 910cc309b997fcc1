// What healthy recordings of a cell leave unexplained: each is diagnosed with the cell identified without it.
#pragma once

#include "healthy_data/healthy_data.hpp"
#include "workflow/identify_cell.hpp"

namespace bms::workflow {

/// Diagnoses the recordings of options.healthy, a long one in blocks. `cell` must not have been identified from a
/// recording that is diagnosed with it: one that is among options.recordings is left out, and identified again without;
/// if it is the only one, its blocks are left out one after another. A block that cannot be diagnosed is left out with
/// a warning. circuit: of the cell, with options.extend; the same one is fitted again, not chosen again. Throws
/// BadInput for a file that cannot be read.
healthy_data::HealthyData learn_healthy(const IdentifyOptions& options, const files::CellFile& cell,
                                        const std::optional<JointResult>& circuit,
                                        std::vector<measurement::Warning>& warnings);

/// "10 blocks of drive.csv, 5.2 h".
std::string healthy_summary(const healthy_data::HealthyData& healthy);

}  // namespace bms::workflow
