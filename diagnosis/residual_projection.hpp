// How much columns could still explain of a fit's residual while the base parameters and all estimated parameters
// follow: both are projected out.
#pragma once

#include <Eigen/Cholesky>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

class ResidualProjection {
 public:
  /// Whitened by the likelihood's noise model, as the fit's residual is.
  ResidualProjection(const LikelihoodModel& likelihood, const HypothesisFit& fit);

  /// To first order, strengths x of the columns lower the cost by 2 x'toward - x'gram x.
  struct Products {
    Eigen::MatrixXd gram;
    Eigen::VectorXd toward;
  };
  /// columns: white, LikelihoodModel::samples() rows.
  Products of(const Columns& columns) const;

 private:
  Eigen::VectorXd residual_;
  Columns known_;                        ///< derivatives by the base parameters, then by the estimated parameters
  Eigen::LDLT<Eigen::MatrixXd> normal_;  ///< known' known plus priors
  Eigen::VectorXd pulled_;               ///< step of the known parameters alone
};

}  // namespace bms::diagnosis
