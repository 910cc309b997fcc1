// How far a healthy reading may lie from the voltage that a cell file predicts: the band of its prediction.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "measurement/healthy_data.hpp"

namespace bms::diagnosis {

/// Standard deviation of each reading of a record around the voltage of the cell file as it is [V]: the noise on all
/// its time scales, and the base parameters within their tolerance, but no less than healthy recordings were wrong at
/// that state of charge. regimes: empty if no healthy recordings are known. 1.96 times it should hold 95 % of the
/// readings.
std::vector<double> predicted_sigma_v(const LikelihoodModel& likelihood, std::size_t record,
                                      const std::vector<measurement::HealthyRegime>& regimes);

}  // namespace bms::diagnosis
