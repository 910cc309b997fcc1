// Columns without physics over all recordings, in families that are tested one by one. No family is a curve over the
// current alone: a phase of constant current turns it into a drift.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// A range of columns that is tested by itself.
struct ColumnFamily {
  const char* depends_on;  ///< in words
  Eigen::Index first, count;
};

struct GenericColumns {
  std::vector<ColumnFamily> families;
  Columns columns;  ///< [V], not white; LikelihoodModel::samples() rows
};

/// Over the simulation of a fit.
GenericColumns generic_columns(const LikelihoodModel& likelihood, const HypothesisFit& fit);

/// Frequencies [Hz] at which something from outside would show: not those of a profile that repeats itself, where a
/// small error of the model repeats as well.
std::vector<double> strange_frequencies(const PreparedRecording& record);

/// Cosine and sine over the first record, 0 in the others: two columns per frequency, LikelihoodModel::samples() rows,
/// not white.
Columns sine_columns(const LikelihoodModel& likelihood, std::span<const double> frequencies_hz);

}  // namespace bms::diagnosis
