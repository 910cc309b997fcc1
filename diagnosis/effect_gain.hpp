// What an effect of known size would gain in a recording: the recording as it is, with the effect put in. Far above the
// noise this is less than the square of its size over its standard deviation, because a hypothesis without it is judged
// with the noise that it leaves.
#pragma once

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

class EffectGain {
 public:
  /// The recordings as a fit describes them, and the noise that is nominal. Copies the likelihood.
  EffectGain(const LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control);

  /// Gain of a hypothesis with this mechanism over the control, if it were so. Called from several threads.
  double of(const MechanismSetting& setting) const;

 private:
  /// -2 log posterior of a raw residual with the noise that it makes most probable.
  double cost_of(const Columns& raw, const Eigen::VectorXd& calibration) const;

  LikelihoodModel likelihood_;
  NoiseModel nominal_;
  HypothesisFit control_;
  double cost_ = 0;  ///< of the control
};

}  // namespace bms::diagnosis
