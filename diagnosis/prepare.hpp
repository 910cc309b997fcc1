// A recording that is trusted, made ready for fits: the noise that is there before any hypothesis, the current without
// its sensor's noise.
#pragma once

#include <vector>

#include "diagnosis/hypothesis.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/record.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// White as the voltages are, fast and slow as the cell file's tolerance has them.
NoiseModel nominal_noise(const std::vector<Record>& records, const model::CellParameters<>& cell);

/// Of recordings whose data faults have been looked for and whose bad readings are taken out (trust.hpp).
Evidence evidence_of(const model::CellParameters<>& cell, const std::vector<model::MechanismSetting>& own,
                     std::vector<Record> records);

}  // namespace bms::diagnosis
