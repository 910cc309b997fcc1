// Checked recordings made ready for fits: the noise that exists before any hypothesis, and the current without its
// sensor's noise.
#pragma once

#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/noise.hpp"
#include "diagnosis/prepared_recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::diagnosis {

/// White noise as measured in the voltages, fast and slow noise from the cell file's tolerance.
NoiseModel nominal_noise(const std::vector<PreparedRecording>& records, const model::CellParameters<>& cell);

/// records: checked, their bad readings removed (recording_check.hpp). own: mechanisms of the cell file. regimes:
/// errors of healthy recordings.
LikelihoodModel likelihood_model_of(const model::CellParameters<>& cell,
                                    const std::vector<model::MechanismSetting>& own,
                                    std::vector<PreparedRecording> records,
                                    const std::vector<healthy_data::HealthyRegime>& regimes = {});

}  // namespace bms::diagnosis
