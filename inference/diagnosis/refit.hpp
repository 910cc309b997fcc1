// A fit continued: with the noise that it leaves, to its minimum, or without one of its mechanisms.
#pragma once

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// Fitted again with the noise model that its own residual makes most probable. With the nominal noise, details that
/// last seconds outvote everything else in a gross mismatch.
HypothesisFit own_noise_fit(LikelihoodModel& likelihood, const NoiseModel& nominal, HypothesisFit f);

/// -2 log posterior with the noise model that the residual makes most probable, at its price.
double posterior_cost(const LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& f);

/// Fitted on until nothing is gained any more, each time with base parameters' derivatives from where it stands.
HypothesisFit fitted_on(LikelihoodModel& likelihood, const NoiseModel& nominal, HypothesisFit f);

/// The rest of a fit without a mechanism, fitted again from where it was. The model has the fit's noise.
HypothesisFit fitted_without(LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& f,
                             std::size_t mechanism);

}  // namespace bms::diagnosis
