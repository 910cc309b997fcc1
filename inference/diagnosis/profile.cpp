#include "diagnosis/profile.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "diagnosis/fit_parameters.hpp"
#include "diagnosis/numerics.hpp"
#include "numerics/in_parallel.hpp"

namespace bms::diagnosis {

namespace {

/// A hypothesis with the base parameters that fit it best.
struct Place {
  Hypothesis hypothesis;
  Eigen::VectorXd calibration;
  double cost = 0;
};

Place best_base(const LikelihoodModel& likelihood, const FitParameters& parameters, Hypothesis h, Eigen::VectorXd u) {
  Eigen::VectorXd residual = likelihood.residual(h, u);
  double least = residual.squaredNorm() + u.squaredNorm();
  for (int step = 0; step < profile_steps; ++step) {
    const auto around = likelihood.linearised_at(h, u);
    Eigen::VectorXd moved = u + around->normal.solve(around->columns.transpose() * residual - u);
    residual = likelihood.residual(h, moved);
    const double cost = residual.squaredNorm() + moved.squaredNorm();
    if (!(cost < least)) break;
    least = cost;
    u = std::move(moved);
  }
  const double prior = parameters.prior(h);
  return {std::move(h), std::move(u), least + prior};
}

/// A parameter moved away from a fit.
struct View {
  Eigen::Index parameter;
  double value, by;  ///< its value there; distance from the fit
  double most;       ///< distance asked for; a bound may be nearer
  bool near;         ///< one of those that give the width
};

std::vector<View> views_from(const HypothesisFit& fit, const FitParameters& parameters) {
  std::vector<View> views;
  for (Eigen::Index j = 0; j < parameters.size(); ++j) {
    const ParameterRef& p = parameters.sought()[static_cast<std::size_t>(j)];
    const double value = parameters.of(fit.hypothesis, j),
                 sigma = fit.hypothesis.settings[p.setting].deviation[p.parameter];
    if (p.parameter > 0 || parameters.is_shape(j) || !(sigma > 0)) continue;
    for (const double times : profile_sigmas) {
      for (const double sign : {-1.0, 1.0}) {
        const double moved = parameters.clamped(j, value + sign * times * sigma);
        views.push_back({j, moved, std::abs(moved - value), times * sigma, times == profile_sigmas.front()});
      }
    }
  }
  return views;
}

}  // namespace

HypothesisFit profiled(const LikelihoodModel& likelihood, HypothesisFit fit) {
  std::vector<double> widest(fit.hypothesis.sought().size(), 0);
  for (int round = 0; round < profile_rounds; ++round) {
    const FitParameters parameters(likelihood.cell(), fit.hypothesis);
    std::fill(widest.begin(), widest.end(), 0);
    const std::vector<View> views = views_from(fit, parameters);
    std::vector<Place> places(views.size());
    numerics::in_parallel(views.size(), [&](std::size_t k) {
      Hypothesis moved = fit.hypothesis;
      parameters.of(moved, views[k].parameter) = views[k].value;
      places[k] = best_base(likelihood, parameters, std::move(moved), fit.calibration);
    });
    const Place* better = nullptr;
    for (std::size_t k = 0; k < views.size(); ++k) {
      const double rise = places[k].cost - fit.cost;
      if (rise < 0 && (better == nullptr || places[k].cost < better->cost)) better = &places[k];
      double& width = widest[static_cast<std::size_t>(views[k].parameter)];
      if (rise > 0 && views[k].near) width = std::max(width, std::min(views[k].by / std::sqrt(rise), views[k].most));
    }
    if (better == nullptr) break;
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
