// What columns could still explain of a fit's residual when the base parameters and everything sought may move along:
// both projected out.
#pragma once

#include <Eigen/Cholesky>

#include "diagnosis/hypothesis.hpp"

namespace bms::diagnosis {

class LeftOver {
 public:
  /// Whitened by the evidence's noise, as the fit's residual is.
  LeftOver(const LikelihoodModel& evidence, const HypothesisFit& fit);

  /// To first order, strengths x of the columns lower the cost by 2 x toward - x gram x.
  struct Products {
    Eigen::MatrixXd gram;
    Eigen::VectorXd toward;
  };
  /// columns: white, a row each of evidence.samples().
  Products of(const Columns& columns) const;

 private:
  Eigen::VectorXd residual_;
  Columns known_;                        ///< derivatives by the base parameters, then by what is sought
  Eigen::LDLT<Eigen::MatrixXd> normal_;  ///< known' known and what is known beforehand
  Eigen::VectorXd pulled_;               ///< where known_ would go alone
};

}  // namespace bms::diagnosis
