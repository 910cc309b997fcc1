// The estimator with this board's cell: the one place where generated tables come in.
#pragma once

#include <cstdint>

#include "estimator/soc_estimator.hpp"
#include "firmware/messages.hpp"

namespace bms {

#if defined(BMS_FIXED_POINT)
using BoardScalar = model::FixedPoint;  // a core without an FPU
#else
using BoardScalar = float;
#endif

/// One step. A function of its own so that its cost can be counted.
Estimate<BoardScalar> estimator_step(SocEstimator<BoardScalar>& estimator, const Sample& sample);

messages::Identity identity();

}  // namespace bms
