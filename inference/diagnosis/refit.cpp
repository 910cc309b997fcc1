#include "diagnosis/refit.hpp"

#include <utility>

#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"

namespace bms::diagnosis {

HypothesisFit own_noise_fit(LikelihoodModel& likelihood, const NoiseModel& nominal, HypothesisFit f) {
  for (int round = 0; round < numerics.search.noise_rounds; ++round) {
    double cost = 0;
    const NoiseModel noise =
        likelihood.likeliest_noise(likelihood.raw_residual(f.hypothesis, f.calibration), nominal, cost);
    if (noise == f.noise) {
      f.likeliest_cost = cost;
      break;
    }
    likelihood.set_noise(noise);
    f = likelihood.fit(f.hypothesis, f.calibration, numerics.fit.refit_iterations);
  }
  return f;
}

double posterior_cost(const LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& f) {
  double cost = 0;
  if (f.likeliest_cost)
    cost = *f.likeliest_cost;
  else
    likelihood.likeliest_noise(likelihood.raw_residual(f.hypothesis, f.calibration), nominal, cost);
  return cost + f.cost - f.residual.squaredNorm();
}

HypothesisFit fitted_on(LikelihoodModel& likelihood, const NoiseModel& nominal, HypothesisFit f) {
  double sum = posterior_cost(likelihood, nominal, f);
  for (int round = 0; round < numerics.search.converged_rounds; ++round) {
    likelihood.set_noise(f.noise);
    likelihood.linearise(f.hypothesis, f.calibration);
    HypothesisFit next = own_noise_fit(likelihood, nominal, likelihood.fit(f.hypothesis, f.calibration));
    const double next_sum = posterior_cost(likelihood, nominal, next), gained = sum - next_sum;
    if (!(gained > 0)) break;
    f = std::move(next);
    sum = next_sum;
    if (gained < numerics.search.converged) break;
  }
  return f;
}

HypothesisFit fitted_without(LikelihoodModel& likelihood, const NoiseModel& nominal, const HypothesisFit& f,
                             std::size_t mechanism) {
  HypothesisFit rest =
      own_noise_fit(likelihood, nominal,
                    likelihood.fit(without(f.hypothesis, mechanism), f.calibration, numerics.fit.reduced_iterations));
  // where it decides whether the mechanism is needed, as far as the best was
  const bool close =
      posterior_cost(likelihood, nominal, rest) < posterior_cost(likelihood, nominal, f) + thresholds.decision.hopeless;
  return close ? fitted_on(likelihood, nominal, std::move(rest)) : rest;
}

}  // namespace bms::diagnosis
