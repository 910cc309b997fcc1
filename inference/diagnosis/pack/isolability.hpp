// What a typical cell of this pack would show on this recording: which causes could be distinguished, which sizes would
// be found, and which sensor would help most.
#pragma once

#include <vector>

#include "diagnosis/pack/cell_fit.hpp"
#include "diagnosis/pack/pack_likelihood.hpp"
#include "diagnosis/pack/pack_verdict.hpp"

namespace bms::diagnosis::pack {

/// information: of a typical healthy cell, with all rows. unseen_share: as in Track. The data of a fault are what the
/// model gives without noise.
Isolability isolability_of(const Matrix& information, const Vector& healthy, double r0_ohm, double unseen_share);

/// The sizes at which a cause that is alone in this cell would be named: by its gain, its significance, and the size
/// that is worth a visit. A size that no cell, connection or channel can have is left out. likelihood: of this pack.
std::vector<PackLimit> detection_limits_of(const Matrix& information, const Vector& healthy, double r0_ohm,
                                           const PackLikelihood& likelihood);

/// The causes of a cell that are not among these limits.
std::vector<Cause> without_limit(const std::vector<PackLimit>& limits);

}  // namespace bms::diagnosis::pack
