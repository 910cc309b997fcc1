// The noise model that a residual makes most probable: a coordinate search over its amplitudes.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "diagnosis/noise.hpp"

namespace bms::diagnosis {

/// -2 log posterior of each noise model, with price_of_noise().
using CostsOfNoise = std::function<std::vector<double>(std::span<const NoiseModel>)>;

struct LikeliestNoise {
  NoiseModel noise;
  double cost;
};

/// Changes one amplitude at a time as long as the cost falls, none below the nominal one. with_checks: those of checks
/// as well. Several noise models are compared at once; the result is that of one after another.
LikeliestNoise search_noise(const NoiseModel& nominal, bool with_checks, const CostsOfNoise& costs_of);

}  // namespace bms::diagnosis
