// How far a healthy reading may lie from the voltage that a cell file predicts: the band of its prediction.
#pragma once

#include <cstddef>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "healthy_data/healthy_data.hpp"

namespace bms::diagnosis {

/// Standard deviation of each reading of a record around the voltage of the cell file as it is [V]; 1.96 times it
/// should hold 95 % of the readings. The cell file alone expects the noise on all its time scales, and the base
/// parameters within their tolerance. Where healthy recordings were that were left out, their own mean square at this
/// state of charge counts with their number, and what the file expects as `tolerance_counts` more, at the level that
/// their errors show; the fewer they are, the wider (Student). Where none was, or if the current goes beyond theirs,
/// the tolerance is wider, and what they showed beyond it is added. likelihood: without learned errors.
std::vector<double> predicted_sigma_v(const LikelihoodModel& likelihood, std::size_t record,
                                      const healthy_data::HealthyData& healthy = {});

}  // namespace bms::diagnosis
