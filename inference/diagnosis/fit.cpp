// Maximum a posteriori of a hypothesis: damped Gauss-Newton over the mechanisms' parameters theta, the base parameters
// u eliminated at every step (variable projection), bounds kept by an active set. Equations: docs/diagnosis_method.md.
#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Cholesky>

#include "diagnosis/fit_parameters.hpp"
#include "diagnosis/likelihood_model.hpp"
#include "diagnosis/products.hpp"

namespace bms::diagnosis {

namespace {

constexpr const Numerics::Fit& fit_numerics = numerics.fit;

/// Room that each step has.
struct StepBounds {
  Eigen::VectorXd low, high;
};

/// Solves the damped normal equations with some steps fixed.
Eigen::VectorXd solve_with_fixed(const Eigen::MatrixXd& normal, const Eigen::VectorXd& rhs, double damping,
                                 const std::vector<char>& fixed, const Eigen::VectorXd& at) {
  const Eigen::Index m = rhs.size();
  const auto is_fixed = [&](Eigen::Index j) { return fixed[static_cast<std::size_t>(j)] != 0; };
  Eigen::MatrixXd s = normal;
  Eigen::VectorXd b = rhs;
  for (Eigen::Index j = 0; j < m; ++j)
    s(j, j) += damping * normal(j, j) + fit_numerics.ridge + fit_numerics.ridge_share * normal.diagonal().maxCoeff();
  for (Eigen::Index j = 0; j < m; ++j) {
    if (is_fixed(j)) b -= normal.col(j) * at[j];
  }
  for (Eigen::Index j = 0; j < m; ++j) {
    if (!is_fixed(j)) continue;
    s.row(j).setZero();
    s.col(j).setZero();
    s(j, j) = 1;
    b[j] = at[j];
  }
  return s.ldlt().solve(b);
}

/// Step of the damped normal equations within bounds. Parameters that would leave their room go to its end and stay
/// there while the others' steps are solved again, until all are inside (active set).
Eigen::VectorXd bounded_step(const Eigen::MatrixXd& normal, const Eigen::VectorXd& rhs, double damping,
                             const StepBounds& room) {
  const Eigen::Index m = rhs.size();
  std::vector<char> fixed(static_cast<std::size_t>(m), 0);
  Eigen::VectorXd step = Eigen::VectorXd::Zero(m), at(m);
  for (Eigen::Index round = 0; round <= m; ++round) {
    step = solve_with_fixed(normal, rhs, damping, fixed, at);
    bool more = false;
    for (Eigen::Index j = 0; j < m; ++j) {
      char& is_fixed = fixed[static_cast<std::size_t>(j)];
      if (is_fixed != 0 || (step[j] >= room.low[j] && step[j] <= room.high[j])) continue;
      is_fixed = 1;
      at[j] = std::clamp(step[j], room.low[j], room.high[j]);
      more = true;
    }
    if (!more) break;
  }
  return step;
}

}  // namespace

/// One fit in progress.
class GaussNewton {
 public:
  using Linearisation = LikelihoodModel::Linearisation;

  GaussNewton(const LikelihoodModel& likelihood, const Hypothesis& start, const Eigen::VectorXd& calibration);
  HypothesisFit run(int iterations, double hopeless);

 private:
  /// The normal equations at the current point.
  struct NormalEquations {
    Eigen::VectorXd u_gradient, u_alone;  ///< of the base parameters, and their step if theta stays
    Eigen::VectorXd rhs;                  ///< of theta, u eliminated
    Eigen::MatrixXd solved;               ///< (J_u' J_u + I)^-1 J_u' J_theta: how u follows theta
    double within_reach = 0;              ///< gain of the full step if all were linear and unbounded
  };
  struct Attempt {
    bool better = false, astray = false;
  };

  double cost_of(Hypothesis& h, const Eigen::VectorXd& u, const Eigen::VectorXd& residual) const {
    return residual.squaredNorm() + u.squaredNorm() + parameters_.prior(h);
  }
  LikelihoodModel::Point here() const { return {fit_.hypothesis, fit_.calibration}; }
  void derive();
  NormalEquations normal_equations();
  Attempt attempt_step(const NormalEquations& equations);
  bool linearise_again(const Attempt& attempt, int iteration, int& iterations);
  void finish();

  const LikelihoodModel& likelihood_;
  FitParameters parameters_;
  Eigen::Index m_;  ///< number of parameters
  HypothesisFit fit_;
  double cost_at_start_ = 0;
  std::shared_ptr<const Linearisation> around_;
  std::optional<LikelihoodModel::Point> derived_at_;
  Columns by_theta_;         ///< there, per unit step
  Eigen::MatrixXd schur_;    ///< of theta, u eliminated
  Eigen::VectorXd natural_;  ///< d parameter / d step
  double damping_ = fit_numerics.damping;
  int quiet_ = 0, renewals_ = 0;
};

GaussNewton::GaussNewton(const LikelihoodModel& likelihood, const Hypothesis& start, const Eigen::VectorXd& calibration)
    : likelihood_(likelihood),
      parameters_(likelihood.cell_, start),
      m_(parameters_.size()),
      fit_{start, calibration, {}, 0, likelihood.noise_, {}, {}, std::vector<char>(static_cast<std::size_t>(m_), 0),
           false},
      natural_(Eigen::VectorXd::Ones(m_)) {
  for (Eigen::Index j = 0; j < m_; ++j) {
    double& value = parameters_.of(fit_.hypothesis, j);
    value = parameters_.clamped(j, value);
  }
  fit_.residual = likelihood.residual(fit_.hypothesis, fit_.calibration);
  fit_.cost = cost_of(fit_.hypothesis, fit_.calibration, fit_.residual);
  cost_at_start_ = fit_.cost;
  if (!likelihood.has_linearisation()) likelihood.linearise(likelihood.base(), likelihood.unchanged());
  around_ = likelihood.nearby_.get();
}

/// Derivatives by theta, as long as the fit stands where they were taken.
void GaussNewton::derive() {
  if (derived_at_ == here()) return;
  derived_at_ = here();
  by_theta_ = likelihood_.derivatives(fit_.hypothesis, fit_.calibration, parameters_.sought());
  for (Eigen::Index j = 0; j < m_; ++j) natural_[j] = parameters_.natural(j, parameters_.of(fit_.hypothesis, j));
  by_theta_ *= natural_.asDiagonal();
}

GaussNewton::NormalEquations GaussNewton::normal_equations() {
  derive();
  const Columns& j_theta = by_theta_;
  const Columns& j_u = around_->columns;
  NormalEquations e;
  e.u_gradient = j_u.transpose() * fit_.residual - fit_.calibration;
  e.u_alone = around_->normal.solve(e.u_gradient);
  e.within_reach = e.u_gradient.dot(e.u_alone);
  if (m_ == 0) return e;
  Eigen::VectorXd gradient = j_theta.transpose() * fit_.residual;
  Eigen::MatrixXd normal = squared(j_theta);
  for (Eigen::Index j = 0; j < m_; ++j) {
    const PriorDistance prior = parameters_.prior_distance(j, parameters_.of(fit_.hypothesis, j));
    if (prior.sigma == 0) continue;
    const double per = parameters_.is_shape(j) ? 1 / prior.sigma : natural_[j] / prior.sigma;
    gradient[j] -= prior.away * per;
    normal(j, j) += per * per;
  }
  const Eigen::MatrixXd cross = products(j_u, j_theta);
  e.solved = around_->normal.solve(cross);
  schur_ = normal - cross.transpose() * e.solved;
  e.rhs = gradient - cross.transpose() * e.u_alone;
  Eigen::MatrixXd regular = schur_;
  for (Eigen::Index j = 0; j < m_; ++j) regular(j, j) += fit_numerics.ridge_reach * schur_(j, j) + fit_numerics.ridge;
  e.within_reach += e.rhs.dot(regular.ldlt().solve(e.rhs));
  return e;
}

/// Tries steps with growing damping until one lowers the cost.
GaussNewton::Attempt GaussNewton::attempt_step(const NormalEquations& e) {
  StepBounds room{Eigen::VectorXd(m_), Eigen::VectorXd(m_)};
  for (Eigen::Index j = 0; j < m_; ++j)
    std::tie(room.low[j], room.high[j]) = parameters_.room(j, parameters_.of(fit_.hypothesis, j));
  Attempt result;
  for (int attempt = 0; attempt < fit_numerics.attempts && !result.better; ++attempt) {
    const Eigen::VectorXd step = m_ > 0 ? bounded_step(schur_, e.rhs, damping_, room) : Eigen::VectorXd();
    Hypothesis trial = fit_.hypothesis;
    for (Eigen::Index j = 0; j < m_; ++j)
      parameters_.of(trial, j) = parameters_.moved(j, parameters_.of(fit_.hypothesis, j), step[j]);
    // where the base parameters' derivatives are stale, they go a shorter way as well
    const double way = 1 / (1 + fit_numerics.calibration_way * damping_);
    Eigen::VectorXd toward = e.u_alone;
    if (m_ > 0) toward -= e.solved * step;
    const Eigen::VectorXd u = fit_.calibration + way * toward;
    const Eigen::VectorXd residual = likelihood_.residual(trial, u);
    const double cost = cost_of(trial, u, residual);
    double promised = e.u_gradient.dot(e.u_alone);
    if (m_ > 0) promised += 2 * e.rhs.dot(step) - step.dot(schur_ * step);
    if (fit_.cost - cost < fit_numerics.kept_promise * promised &&
        promised > fit_numerics.promise + fit_numerics.promise_share * fit_.cost)
      result.astray = true;
    if (!(cost < fit_.cost)) {  // also where there is no number
      damping_ *= fit_numerics.damping_more;
      continue;
    }
    result.better = true;
    quiet_ = fit_.cost - cost < fit_numerics.quiet + fit_numerics.quiet_share * fit_.cost ? quiet_ + 1 : 0;
    fit_.hypothesis = trial;
    fit_.calibration = u;
    fit_.residual = residual;
    fit_.cost = cost;
    damping_ = std::max(damping_ / fit_numerics.damping_less, fit_numerics.damping_least);
  }
  return result;
}

/// Linearises in the base parameters at the current point if the fit is far from the last linearisation or a step has
/// not gained what it promised. Returns false if that is not worth it: the fit has converged. Without it the fit of a
/// cell at 5 degrees C, whose resistance is twice the file's, had not converged after 20 steps.
bool GaussNewton::linearise_again(const Attempt& attempt, int iteration, int& iterations) {
  const int most = attempt.astray ? fit_numerics.renewals_astray : fit_numerics.renewals;
  const bool pays = attempt.astray || !attempt.better || cost_at_start_ - fit_.cost > fit_numerics.far_gain;
  if (renewals_ >= most || !pays) return false;
  ++renewals_;
  quiet_ = 0;
  damping_ =
      attempt.astray ? std::max(fit_numerics.damping, damping_ / fit_numerics.damping_restart) : fit_numerics.damping;
  if (!(around_->at == here())) around_ = likelihood_.linearised(fit_.hypothesis, fit_.calibration);
  iterations = std::max(iterations, iteration + fit_numerics.iterations_after_renewal);
  return true;
}

HypothesisFit GaussNewton::run(int iterations, double hopeless) {
  double cost_before = fit_.cost;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const NormalEquations equations = normal_equations();
    if (equations.within_reach < fit_numerics.within_reach) {
      fit_.converged = true;
      break;
    }
    const bool falls = cost_before - fit_.cost > fit_numerics.falls_share * fit_.cost;
    if (iteration >= fit_numerics.iterations_before_hopeless && !falls &&
        fit_.cost - fit_numerics.hopeless_times * equations.within_reach > hopeless)
      break;
    cost_before = fit_.cost;
    const Attempt attempt = attempt_step(equations);
    const bool renewable = attempt.astray && renewals_ < fit_numerics.renewals_astray;
    if (attempt.better && quiet_ == 0 && !renewable) continue;
    if (linearise_again(attempt, iteration, iterations)) continue;
    fit_.converged = true;
    break;
  }
  finish();
  return fit_;
}

/// Bounds reached, covariance and standard deviations.
void GaussNewton::finish() {
  for (Eigen::Index j = 0; j < m_; ++j)
    fit_.at_bound[static_cast<std::size_t>(j)] = parameters_.at_bound(j, parameters_.of(fit_.hypothesis, j)) ? 1 : 0;
  fit_.covariance = Eigen::MatrixXd::Zero(m_, m_);
  if (m_ == 0) return;
  Eigen::MatrixXd s = schur_;
  const double ridge = fit_numerics.ridge_covariance * schur_.diagonal().maxCoeff() + fit_numerics.ridge_covariance;
  for (Eigen::Index j = 0; j < m_; ++j) s(j, j) += ridge;
  const Eigen::MatrixXd inverse = s.ldlt().solve(Eigen::MatrixXd::Identity(m_, m_));
  fit_.covariance = natural_.asDiagonal() * inverse * natural_.asDiagonal();
  for (Eigen::Index j = 0; j < m_; ++j) {
    const ParameterRef& p = parameters_.sought()[static_cast<std::size_t>(j)];
    fit_.hypothesis.settings[p.setting].deviation[p.parameter] = std::sqrt(std::max(fit_.covariance(j, j), 0.0));
  }
}

std::shared_ptr<const LikelihoodModel::Linearisation> LikelihoodModel::linearised(const Hypothesis& h,
                                                                                  const Eigen::VectorXd& u) const {
  return factorised({h, u}, calibration_derivatives(h, u));
}

std::shared_ptr<const LikelihoodModel::Linearisation> LikelihoodModel::factorised(Point at, Columns columns) const {
  auto made = std::make_shared<Linearisation>();
  made->at = std::move(at);
  made->columns = std::move(columns);
  made->gram = squared(made->columns);
  made->gram.diagonal().array() += 1;
  made->normal.compute(made->gram);
  return made;
}

std::shared_ptr<const LikelihoodModel::Linearisation> LikelihoodModel::linearised_at(const Hypothesis& h,
                                                                                     const Eigen::VectorXd& u) const {
  const Point at{h, u};
  for (const auto& known : {nearby_.get(), latest_.get()}) {
    if (known && known->at == at) return known;
  }
  if (!(at == Point{base(), unchanged()})) return latest_.set(linearised(h, u));
  // the noise changes often, this point never
  auto raw = at_base_.get();
  if (!raw) raw = at_base_.set(std::make_shared<const Columns>(raw_calibration_derivatives(h, u)));
  Columns columns = *raw;
  whiten(columns);
  return latest_.set(factorised(at, std::move(columns)));
}

void LikelihoodModel::linearise(const Hypothesis& h, const Eigen::VectorXd& u) const {
  nearby_.set(linearised_at(h, u));
}

HypothesisFit LikelihoodModel::fit(const Hypothesis& start, int iterations) const {
  return fit(start, unchanged(), iterations);
}

HypothesisFit LikelihoodModel::fit(const Hypothesis& start, const Eigen::VectorXd& calibration, int iterations,
                                   double hopeless) const {
  return GaussNewton(*this, start, calibration).run(iterations, hopeless);
}

}  // namespace bms::diagnosis
