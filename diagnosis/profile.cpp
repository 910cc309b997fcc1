#include "diagnosis/profile.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "diagnosis/fit_parameters.hpp"
#include "diagnosis/numerics.hpp"

namespace bms::diagnosis {

namespace {

/// A hypothesis with the base parameters that fit it best.
struct Place {
  Hypothesis hypothesis;
  Eigen::VectorXd calibration;
  double cost = 0;
};

Place best_base(const LikelihoodModel& likelihood, const FitParameters& parameters, Hypothesis h, Eigen::VectorXd u) {
  const auto cost_of = [&](const Eigen::VectorXd& at) {
    return likelihood.residual(h, at).squaredNorm() + at.squaredNorm();
  };
  double least = cost_of(u);
  for (int step = 0; step < profile_steps; ++step) {
    const auto around = likelihood.linearised_at(h, u);
    const Eigen::VectorXd moved = u + around->normal.solve(around->columns.transpose() * likelihood.residual(h, u) - u);
    const double cost = cost_of(moved);
    if (!(cost < least)) break;
    least = cost;
    u = moved;
  }
  const double prior = parameters.prior(h);
  return {std::move(h), std::move(u), least + prior};
}

}  // namespace

HypothesisFit profiled(const LikelihoodModel& likelihood, HypothesisFit fit) {
  std::vector<double> widest(fit.hypothesis.sought().size(), 0);
  for (int round = 0; round < profile_rounds; ++round) {
    const FitParameters parameters(likelihood.cell(), fit.hypothesis);
    std::optional<Place> better;
    std::fill(widest.begin(), widest.end(), 0);
    for (Eigen::Index j = 0; j < parameters.size(); ++j) {
      const ParameterRef& p = parameters.sought()[static_cast<std::size_t>(j)];
      const double value = parameters.of(fit.hypothesis, j),
                   sigma = fit.hypothesis.settings[p.setting].deviation[p.parameter];
      if (p.parameter > 0 || parameters.is_shape(j) || !(sigma > 0)) continue;
      for (const double times : profile_sigmas) {
        for (const double sign : {-1.0, 1.0}) {
          Hypothesis moved = fit.hypothesis;
          parameters.of(moved, j) = parameters.clamped(j, value + sign * times * sigma);
          const double by = std::abs(parameters.of(moved, j) - value);
          Place place = best_base(likelihood, parameters, std::move(moved), fit.calibration);
          const double rise = place.cost - fit.cost;
          if (rise < 0 && (!better || place.cost < better->cost)) better = std::move(place);
          if (rise > 0 && times == profile_sigmas.front())
            widest[static_cast<std::size_t>(j)] =
                std::max(widest[static_cast<std::size_t>(j)], std::min(by / std::sqrt(rise), times * sigma));
        }
      }
    }
    if (!better) break;
    HypothesisFit other = likelihood.fit(better->hypothesis, better->calibration);
    if (!(other.cost < fit.cost - numerics.fit.within_reach)) break;
    fit = std::move(other);
  }
  const FitParameters last(likelihood.cell(), fit.hypothesis);
  const std::vector<ParameterRef> sought = fit.hypothesis.sought();
  for (std::size_t j = 0; j < sought.size(); ++j) {
    const ParameterRef& p = sought[j];
    double& sigma = fit.hypothesis.settings[p.setting].deviation[p.parameter];
    const auto k = static_cast<Eigen::Index>(j);
    double times = sigma > 0 ? std::max(1.0, widest[j] / sigma) : 1;
    // what is rare draws a size to what is common, by as much as the recordings leave it free
    const PriorDistance prior = last.prior_distance(k, last.of(fit.hypothesis, k));
    if (sigma > 0 && prior.sigma > 0 && !last.is_shape(k))
      times *= std::hypot(1, times * sigma * prior.away / prior.sigma);
    sigma *= times;
    fit.covariance.row(k) *= times;
    fit.covariance.col(k) *= times;
  }
  return fit;
}

}  // namespace bms::diagnosis
