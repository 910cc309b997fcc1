#include "diagnosis/effect_gain.hpp"

#include "diagnosis/fit_parameters.hpp"

namespace bms::diagnosis {

EffectGain::EffectGain(const LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& control)
    : likelihood_(likelihood), nominal_(nominal), control_(control) {
  likelihood_.set_noise(nominal);
  likelihood_.linearise(control_.hypothesis, control_.calibration);
  cost_ = cost_of(likelihood_.raw_residual(control_.hypothesis, control_.calibration), control_.calibration);
}

double EffectGain::cost_of(const Columns& raw, const Eigen::VectorXd& calibration) const {
  double cost = 0;
  likelihood_.likeliest_noise(raw, nominal_, cost);
  return cost + calibration.squaredNorm();
}

double EffectGain::of(const MechanismSetting& setting) const {
  const Hypothesis changed = with(control_.hypothesis, setting);
  Columns effect = Columns::Zero(static_cast<Eigen::Index>(likelihood_.samples()), 1);
  Eigen::Index row = 0;
  for (std::size_t r = 0; r < likelihood_.records().size(); ++r) {
    const std::vector<double> without_v = likelihood_.voltage(control_.hypothesis, control_.calibration, r),
                              with_v = likelihood_.voltage(changed, control_.calibration, r);
    for (std::size_t k = 0; k < with_v.size(); ++k) effect(row++, 0) = with_v[k] - without_v[k];
  }
  // what the base parameters follow of it is not seen
  Columns white = effect;
  likelihood_.whiten(white);
  const auto around = likelihood_.linearised_at(control_.hypothesis, control_.calibration);
  const Eigen::VectorXd moved =
      control_.calibration + around->normal.solve(Eigen::VectorXd(around->columns.transpose() * white.col(0)));
  Columns raw = likelihood_.raw_residual(control_.hypothesis, moved) + effect;
  const double price = FitParameters(likelihood_.cell(), changed).prior(changed);
  return cost_of(raw, moved) - cost_ - price;
}

}  // namespace bms::diagnosis
