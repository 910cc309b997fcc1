// What the residual of a fit still contains, asked without physics: columns over time, soc, voltage, current and memory
// that could follow anything, a sine of any period, a reading that follows only in leaps.
//
// If one family of columns gains much on top of the best hypothesis, there is something that the catalogue does not
// explain (UNKNOWN). Each family is tested by itself: all at once gain so much on noise that a small effect drowns (1
// of 5 was found). A part that is faster than any of them shows as a whitened residual with a variance above 1.
#pragma once

#include <optional>
#include <vector>

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/one_place.hpp"

namespace bms::diagnosis {

struct ResidualTest {
  double gain = 0;                                       ///< of the family that gains most, less what it gains on noise
  const char* family = "";                               ///< which: what the residual depends on, in words
  std::optional<PlaceOfGain> only_place = std::nullopt;  ///< of what it explains
  double fast_excess = 0;  ///< variance of the whitened residual above 1, single outliers limited
  double far_out = 0;  ///< share of the whitened residual beyond 4 sigma, sigma from its median if that is larger than
                       ///< 1; 0.00006 for a normal distribution
  std::vector<std::vector<double>> energy;  ///< by record and row: squares of what the generic columns explain [V^2]
  std::vector<model::Span> spans;           ///< where most of it lies, in the first record
};

ResidualTest test_residual(const LikelihoodModel& likelihood, const HypothesisFit& fit);

}  // namespace bms::diagnosis
