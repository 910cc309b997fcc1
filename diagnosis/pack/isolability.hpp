// What a typical cell of this pack would show on this recording: which causes could be distinguished, which sizes would
// be found, and which sensor would help most.
#pragma once

#include <vector>

#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::diagnosis::pack {

/// information: of a typical healthy cell, with all rows. The data of a fault are what the model gives without noise.
Isolability isolability_of(const Matrix& information, const Vector& healthy, double r0_ohm);

std::vector<PackLimit> detection_limits_of(const Matrix& information, const Vector& healthy, double r0_ohm,
                                           double least_gain);

}  // namespace bms::diagnosis::pack
