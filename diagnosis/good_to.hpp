// What an extended cell file is good to.
#pragma once

#include <vector>

#include "diagnosis/record.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::diagnosis {

/// Of the OCV and of the drift.
model::Tolerance widened(model::Tolerance tolerance, double factor);

/// The smallest factor, 1 to 8, by which its tolerances of the OCV and of the drift must be widened so that these
/// recordings, which it was made from, show neither a mechanism more nor an unknown part. A model is not better than
/// what it leaves of its own recordings.
double widening(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& mechanisms,
                std::vector<Record> records);

}  // namespace bms::diagnosis
