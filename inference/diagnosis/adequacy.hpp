// Does the best hypothesis explain enough, or is something left that the catalogue does not contain?
#pragma once

#include <optional>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/one_place.hpp"
#include "diagnosis/residual_test.hpp"
#include "diagnosis/selection.hpp"

namespace bms::diagnosis {

struct Adequacy {
  double control_cost = 0, best_cost = 0;                ///< with nominal noise
  ResidualTest residual;                                 ///< of the best hypothesis, with nominal noise
  double explained = 1;                                  ///< gain over that plus what generic columns still gain
  bool found = false;                                    ///< the best hypothesis adds mechanisms
  std::optional<PlaceOfGain> only_place = std::nullopt;  ///< of what they gain
  bool unknown = false;                                  ///< something is there that they do not explain
};

/// Reduces the survivors to the control hypothesis if they explain little and incompletely. Leaves the likelihood with
/// the noise model of the best hypothesis.
Adequacy judge(LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control,
               Survivors& survivors);

}  // namespace bms::diagnosis
