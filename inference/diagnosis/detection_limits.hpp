// The smallest size of each mechanism that these recordings would have revealed: what the decision asks for, counted
// back to a strength.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "diagnosis/adequacy.hpp"
#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/selection.hpp"
#include "diagnosis/verdict.hpp"

namespace bms::diagnosis {

/// Standard deviation of a mechanism's first strength around the calibration, to first order.
struct StrengthSigma {
  std::size_t mechanism = 0;
  double sigma = 0;
  MechanismSetting start = {};  ///< the most likely form and moment of it
};

/// Of all mechanisms that can be tested, with the nominal noise.
std::vector<StrengthSigma> strength_sigmas(LikelihoodModel& likelihood, const NoiseModel& nominal,
                                           const HypothesisFit& control, const Scope& scope);

/// Gain from which one mechanism is named in recordings that leave so much unexplained: enough to be detected, and
/// either not faint or most of the misfit (adequacy.hpp).
double needed_gain(const ResidualTest& left);

/// Gain that a mechanism needs to stand out from healthy recordings; nothing if it cannot.
using HealthyGain = std::function<std::optional<double>(std::size_t mechanism)>;

/// Gain of a mechanism of this first strength, if it were in the recordings (effect_gain.hpp).
using GainOfSize = std::function<double(const StrengthSigma& mechanism, double size)>;

/// Sizes that are named in 9 of 10 recordings like these. healthy: empty if no healthy recordings are known. gain:
/// empty if a gain is as the square of the size, as far as it is needed. Those of which twice the size is outside of a
/// parameter's bounds are left out: they would hardly be named.
std::vector<DetectionLimit> limits_of(const std::vector<StrengthSigma>& sigmas, const ResidualTest& left,
                                      double capacity_ah, const HealthyGain& healthy, const GainOfSize& gain = {});

/// Mechanisms that were tested and are not found, and that these recordings would hardly show at any possible size:
/// they have no limit. Empty if nothing was tested to the end. A loose contact, which is searched and not projected, is
/// never among them.
std::vector<std::size_t> not_visible(const Diagnosis& d);

}  // namespace bms::diagnosis
