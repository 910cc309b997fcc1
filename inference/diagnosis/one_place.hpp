// Whether all that speaks for a hypothesis lies in one place of the recordings.
//
// A cell file's tolerance is that of its tables. At the end of a discharge, or after the load, any model is off by
// more, and some mechanism always fits one such place. A fault acts wherever its current flows. Without healthy
// recordings of the cell nothing says how wrong the model is there.
//
// Without this rule 29 of 68 healthy discharges of NASA cells had a cause. In all of them nine tenths of the gain came
// from one twelfth of the recording, mostly the end of the load, in half of them from one reading. In synthetic cases
// the gain is spread.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Rows of a record.
struct PlaceOfGain {
  std::size_t record = 0, first = 0, count = 0;
};

/// The place from which a fit has most of its gain over `control`, if the rest of the recordings would not be enough to
/// name anything. Nothing for a contact that goes and comes back while the same current flows. Both fits with the
/// likelihood's noise model.
std::optional<PlaceOfGain> only_place(const LikelihoodModel& likelihood, const HypothesisFit& control,
                                      const HypothesisFit& fit);

/// The same of a whitened residual without and with columns that could follow anything. calibration_relief: reduction
/// of the calibration penalty.
std::optional<PlaceOfGain> only_place(const LikelihoodModel& likelihood, const Eigen::VectorXd& before,
                                      const Eigen::VectorXd& after, double calibration_relief);

/// What a hypothesis adds, not to be named because of its only place. gains: by mechanism.
std::vector<Withheld> withheld_at(const LikelihoodModel& likelihood, const PlaceOfGain& place, const Hypothesis& h,
                                  const std::map<std::size_t, double>& gains, double false_alarm_rate);

}  // namespace bms::diagnosis
