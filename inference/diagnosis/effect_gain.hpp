// What an effect of known size would gain in a recording: the recording as it is, with the effect put in. Far above the
// noise this is less than the square of its size over its standard deviation, because a hypothesis without it is judged
// with the noise that it leaves. Detection limits counted back by the square were too small.
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
  /// What is measured more if it were so [V]: one column.
  Columns effect_of(const Hypothesis& changed) const;
  /// Where the base parameters go with an effect that the control does not have, under a likelihood's noise.
  Eigen::VectorXd followed(const LikelihoodModel& under, const Columns& effect) const;

  LikelihoodModel likelihood_;
  NoiseModel nominal_;
  HypothesisFit control_;
  std::vector<std::vector<double>> control_v_;  ///< by record
  Columns residual_, by_base_;                  ///< of the control; not white
  double cost_ = 0;                             ///< of the control
};

}  // namespace bms::diagnosis
