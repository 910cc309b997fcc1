// What a fit leaves, asked with no physics in mind: columns over time, soc, voltage, current and memory that could
// follow anything, a sine of any period, a reading that follows only in leaps.
//
// If one family of columns gains much on top of the best hypothesis, something is there that the catalogue does not
// have (UNKNOWN). Each family is asked by itself: all at once gain so much on noise that a small effect drowns. A part
// that is faster than any of them shows as a whitened residual whose variance is above 1.
#pragma once

#include <vector>

#include "diagnosis/hypothesis.hpp"

namespace bms::diagnosis {

struct Remainder {
  double gain = 0;          ///< of the family that gains most, less what it gains on noise
  const char* family = "";  ///< which: what the rest goes with, in words
  double fast_excess = 0;   ///< variance of the whitened residual above 1, robust against single samples
  double far_out = 0;  ///< share of the whitened residual beyond 4 deviations, by its median where that is more than
                       ///< the noise: of a normal one 0.00006
  std::vector<std::vector<double>> energy;  ///< by record and row: squares of what the generic columns explain, V^2
  std::vector<model::Span> spans;           ///< where most of it lies, of the first record
};

Remainder test_residual(const LikelihoodModel& evidence, const HypothesisFit& fit);

}  // namespace bms::diagnosis
