// A recording that is trusted, made ready for fits: the noise that is there before any hypothesis, the current without
// its sensor's noise.
#pragma once

#include <vector>

#include "diagnosis/hypothesis.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// White as the voltages are, fast and slow as the cell file's tolerance has them.
NoiseModel nominal_noise(const std::vector<PreparedRecording>& records, const model::CellParameters<>& cell);

/// Of recordings whose data faults have been looked for and whose bad readings are taken out (trust.hpp).
LikelihoodModel likelihood_model_of(const model::CellParameters<>& cell,
                                    const std::vector<model::MechanismSetting>& own,
                                    std::vector<PreparedRecording> records);

}  // namespace bms::diagnosis
