// From hypotheses to what is reported: findings with their probabilities and rivals, and a ranking of all that was
// fitted.
#pragma once

#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// One per mechanism of the best hypothesis, the largest gain first.
std::vector<Finding> findings_of(Search& search, const Survivors& survivors, const Contributions& contributed);

/// The best hypothesis and its rivals; if it adds nothing, the mechanisms tried alone. The largest gain first. The
/// share that each explains is of the cell file's error file_v [V] or, if the best adds nothing, of what the base
/// parameters leave.
std::vector<Ranked> ranking_of(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                               const Grown& grown, Survivors& survivors, double file_v);

}  // namespace bms::diagnosis
