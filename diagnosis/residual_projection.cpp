#include "diagnosis/residual_projection.hpp"

#include "diagnosis/numerics.hpp"

namespace bms::diagnosis {

namespace {

Eigen::MatrixXd squared(const Columns& columns) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(columns.cols(), columns.cols());
  product.selfadjointView<Eigen::Lower>().rankUpdate(columns.transpose());
  return product.selfadjointView<Eigen::Lower>();
}

}  // namespace

ResidualProjection::ResidualProjection(const LikelihoodModel& likelihood, const HypothesisFit& fit)
    : residual_(fit.residual) {
  const Columns base = likelihood.calibration_derivatives(fit.hypothesis, fit.calibration),
                own = likelihood.derivatives(fit.hypothesis, fit.calibration, fit.hypothesis.sought());
  known_.resize(base.rows(), base.cols() + own.cols());
  known_.leftCols(base.cols()) = base;
  if (own.cols() > 0) known_.rightCols(own.cols()) = own;
  Eigen::MatrixXd normal = squared(known_);
  for (Eigen::Index k = 0; k < normal.rows(); ++k)
    normal(k, k) += k < base.cols() ? 1 : numerics.signatures.prior * (1 + normal(k, k));
  normal_.compute(normal);
  Eigen::VectorXd pull = known_.transpose() * residual_;
  pull.head(base.cols()) -= fit.calibration;
  pulled_ = normal_.solve(pull);
}

ResidualProjection::Products ResidualProjection::of(const Columns& columns) const {
  const Eigen::MatrixXd cross = known_.transpose() * columns;
  return {squared(columns) - cross.transpose() * normal_.solve(cross),
          columns.transpose() * residual_ - cross.transpose() * pulled_};
}

}  // namespace bms::diagnosis
