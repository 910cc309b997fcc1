// Which causes a recording can distinguish at its noise, and what would distinguish the others.
//
// A cause of some size moves the whitened voltage by x, the base parameters projected out. Another one explains of that
// what its own signatures reach, at any of their shapes and strengths. What is left,
//
//   left(a, b) = min over shapes of b, min over strengths y  |x_a - W_b y|^2
//
// is the gain by which a would be preferred to b if a were there, to first order. The size is Thresholds::Isolability::
// times_limit detection limits: what can be distinguished at that size can be at any larger one.
#pragma once

#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Of the causes with a detection limit, but not of a loose contact, which has no signature. A pair that is not
/// separable is tried with a second voltmeter, a second ammeter, and the courses of evidence/experiments/ from the
/// shortest on, each for itself; the first that separates it is named.
Isolability isolability_of(const LikelihoodModel& likelihood, const NoiseModel& nominal,
                           const std::vector<DetectionLimit>& limits);

}  // namespace bms::diagnosis
