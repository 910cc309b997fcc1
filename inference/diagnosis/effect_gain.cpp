#include "diagnosis/effect_gain.hpp"

#include <algorithm>
#include <limits>

#include <Eigen/Cholesky>

#include "diagnosis/fit_parameters.hpp"
#include "diagnosis/products.hpp"

namespace bms::diagnosis {

EffectGain::EffectGain(const LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control)
    : likelihood_(likelihood),
      nominal_(nominal),
      control_(control),
      residual_(likelihood.raw_residual(control.hypothesis, control.calibration)),
      by_base_(likelihood.raw_calibration_derivatives(control.hypothesis, control.calibration)) {
  for (std::size_t r = 0; r < likelihood.records().size(); ++r)
    control_v_.push_back(likelihood.voltage(control.hypothesis, control.calibration, r));
  likelihood_.set_noise(nominal);
  likelihood_.likeliest_noise(residual_, nominal_, cost_);
  cost_ += control_.calibration.squaredNorm();
}

Columns EffectGain::effect_of(const Hypothesis& changed) const {
  Columns effect = Columns::Zero(static_cast<Eigen::Index>(likelihood_.samples()), 1);
  Eigen::Index row = 0;
  for (std::size_t r = 0; r < likelihood_.records().size(); ++r) {
    const std::vector<double> with_v = likelihood_.voltage(changed, control_.calibration, r);
    for (std::size_t k = 0; k < with_v.size(); ++k) effect(row++, 0) = with_v[k] - control_v_[r][k];
  }
  return effect;
}

Eigen::VectorXd EffectGain::followed(const LikelihoodModel& under, const Columns& effect) const {
  Columns columns = by_base_, residual = residual_ + effect;
  under.whiten(columns);
  under.whiten(residual);
  Eigen::MatrixXd normal = squared(columns);
  normal.diagonal().array() += 1;
  const Eigen::VectorXd pull = columns.transpose() * residual.col(0) - control_.calibration;
  return control_.calibration + normal.llt().solve(pull);
}

double EffectGain::of(const MechanismSetting& setting) const {
  const Hypothesis changed = with(control_.hypothesis, setting);
  const Columns effect = effect_of(changed);
  LikelihoodModel under = likelihood_;
  double least = std::numeric_limits<double>::infinity();
  // noise and base parameters in turn, as in a fit: with the noise that is left they follow further
  for (int round = 0; round <= numerics.search.noise_rounds; ++round) {
    const Eigen::VectorXd moved = followed(under, effect);
    const Columns raw = likelihood_.raw_residual(control_.hypothesis, moved) + effect;
    double cost = 0;
    const NoiseModel noise = likelihood_.likeliest_noise(raw, nominal_, cost);
    least = std::min(least, cost + moved.squaredNorm());
    if (noise == under.noise()) break;
    under.set_noise(noise);
  }
  return least - cost_ - FitParameters(likelihood_.cell(), changed).prior(changed);
}

}  // namespace bms::diagnosis
