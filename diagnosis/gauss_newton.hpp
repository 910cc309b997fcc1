// One fit in progress, which can be continued: candidates that are compared begin together, and those that have fallen
// behind are not fitted to the end. The method stands in fit.cpp.
#pragma once

#include <limits>
#include <memory>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "diagnosis/fit_parameters.hpp"
#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

/// J_u and the factors of J_u' J_u + I.
struct LikelihoodModel::Linearisation {
  Columns columns;  ///< J_u, white
  Eigen::LLT<Eigen::MatrixXd> normal;
};

class GaussNewton {
 public:
  /// likelihood: must outlive it, with the same noise model.
  GaussNewton(const LikelihoodModel& likelihood, const Hypothesis& start, const Eigen::VectorXd& calibration,
              int iterations);

  /// Goes on until it has converged, has made `until` iterations in total, or cannot get below `hopeless` even if each
  /// step gains all that it promises.
  void run(int until, double hopeless = std::numeric_limits<double>::infinity());
  double cost() const { return fit_.cost; }
  HypothesisFit result() &&;

 private:
  using Linearisation = LikelihoodModel::Linearisation;

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
  NormalEquations normal_equations();
  Attempt attempt_step(const NormalEquations& equations);
  bool linearise_again(const Attempt& attempt);
  void finish();

  const LikelihoodModel& likelihood_;
  FitParameters parameters_;
  Eigen::Index m_;  ///< number of parameters
  HypothesisFit fit_;
  double cost_at_start_ = 0;
  std::shared_ptr<const Linearisation> around_;
  Columns j_theta_;           ///< white, by the parameters' steps
  bool as_promised_ = false;  ///< the last step gained what it promised
  int derivatives_age_ = 0;   ///< iterations since j_theta_ was computed
  Eigen::MatrixXd schur_;     ///< of theta, u eliminated
  Eigen::VectorXd natural_;   ///< d parameter / d step
  double damping_ = numerics.fit.damping;
  double within_reach_ = std::numeric_limits<double>::infinity();
  int iteration_ = 0, iterations_;
  int quiet_ = 0, renewals_ = 0;
};

}  // namespace bms::diagnosis
