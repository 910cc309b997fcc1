// From hypotheses to what is reported: findings with their probabilities and rivals, and a ranking of all that was
// fitted.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/locate.hpp"
#include "diagnosis/search.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Gain with which a mechanism stands out from healthy recordings; nothing if they are too few. Empty without them.
using HealthyGain = std::function<std::optional<double>(std::size_t mechanism)>;

/// By how much the error of the model makes differences of likelihood larger than noise does: what healthy recordings
/// show of the mechanism over what chance reaches. 1 without them, and at least.
double model_error_times(const HealthyGain& healthy_gain, std::size_t mechanism);
/// Weight of a hypothesis this far behind the best one, in -2 log posterior.
double weight_behind(double behind);

/// One per mechanism of the best hypothesis, the largest gain first. Of two alike ones the worse is excluded only if it
/// is worse by more than the error of the model makes healthy recordings look.
std::vector<Finding> findings_of(Search& search, const Survivors& survivors, const Contributions& contributed,
                                 const HealthyGain& healthy_gain);

/// The best hypothesis and its rivals; if it adds nothing, the mechanisms tried alone. The largest gain first. The
/// share that each explains is of the cell file's error file_v [V] or, if the best adds nothing, of what the base
/// parameters leave.
std::vector<Ranked> ranking_of(Search& search, const LikelihoodModel& likelihood, const HypothesisFit& control,
                               const Grown& grown, Survivors& survivors, double file_v);

}  // namespace bms::diagnosis
