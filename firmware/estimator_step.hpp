// The estimator with this board's cell: the one place where what is generated comes in, the model's type here, its tables in the .cpp.
#pragma once

#include <cstdint>

#include "cell_constants.hpp"  // generated from the cell file
#include "estimator/soc_estimator.hpp"
#include "firmware/messages.hpp"

namespace bms {

#if defined(BMS_FIXED_POINT)
using BoardScalar = model::FixedPoint;  // a core without an FPU
#else
using BoardScalar = float;
#endif

using BoardEstimator = SocEstimator<BoardScalar, generated::Model>;

/// One step. A function of its own so that its cost can be counted.
BoardEstimator::Result estimator_step(BoardEstimator& estimator, const Sample& sample);

/// What is known beside the estimate, after the step.
void condition_step(Condition<BoardEstimator>& condition, const BoardEstimator& estimator, const Sample& sample, const BoardEstimator::Result& estimate, bool limits_wanted);

messages::Identity identity();
float capacity_ah();

}  // namespace bms
