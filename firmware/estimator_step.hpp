// The estimator with this board's cell: the one place where generated tables come in.
#pragma once

#include <cstdint>

#include "estimator/soc_estimator.hpp"

namespace bms {

#if defined(BMS_FIXED_POINT)
using BoardScalar = model::FixedPoint;  // a core without an FPU
#else
using BoardScalar = float;
#endif

inline constexpr std::uint32_t firmware_version = 0x000100;  // 0.1.0

/// One step. A function of its own so that its cost can be counted.
Estimate<BoardScalar> estimator_step(SocEstimator<BoardScalar>& estimator, const Sample& sample);

/// First 32 bits of the cell file's SHA-256.
std::uint32_t cell_hash();

}  // namespace bms
