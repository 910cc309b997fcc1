// The accuracy of an extended cell file.
#pragma once

#include <vector>

#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// With the tolerances of the OCV and of the drift multiplied.
model::Tolerance with_wider_tolerance(model::Tolerance tolerance, double factor);

/// The smallest factor (ModelToleranceThresholds, 1 to 8) by which the tolerances of the OCV and of the drift must be
/// widened so that the recordings from which the file was made show neither another mechanism nor an unknown part. A
/// model is not more accurate than the residual on its own recordings. With tolerances that were not widened, one of
/// seven instrument faults put into a real recording was named.
double tolerance_factor(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& mechanisms,
                        std::vector<PreparedRecording> records);

}  // namespace bms::diagnosis
