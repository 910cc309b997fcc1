// Noise by maximum likelihood.
#pragma once

#include <functional>
#include <span>

#include "diagnosis/noise.hpp"

namespace bms::diagnosis::pack {

/// Changes one amplitude at a time as long as cost() falls. cost: -2 log likelihood. time_s: of the residual.
NoiseModel search_noise(const NoiseModel& start, std::span<const double> time_s,
                        const std::function<double(const NoiseModel&)>& cost);

}  // namespace bms::diagnosis::pack
