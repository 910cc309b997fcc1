// What an extended cell file is good to.
#pragma once

#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// Of the OCV and of the drift.
model::Tolerance with_wider_tolerance(model::Tolerance tolerance, double factor);

/// The smallest factor, 1 to 8, by which its tolerances of the OCV and of the drift must be widened so that these
/// recordings, which it was made from, show neither a mechanism more nor an unknown part. A model is not better than
/// what it leaves of its own recordings.
double tolerance_factor(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& mechanisms,
                        std::vector<PreparedRecording> records);

}  // namespace bms::diagnosis
