#include "diagnosis/residual_projection.hpp"

#include "diagnosis/numerics.hpp"

namespace bms::diagnosis {

ResidualProjection::ResidualProjection(const LikelihoodModel& likelihood, const HypothesisFit& fit)
    : residual_(fit.residual),
      around_(likelihood.linearised_at(fit.hypothesis, fit.calibration)),
      own_(likelihood.derivatives(fit.hypothesis, fit.calibration, fit.hypothesis.sought())) {
  const Eigen::Index bases = base().cols(), all = bases + own_.cols();
  Eigen::MatrixXd normal(all, all);
  normal.topLeftCorner(bases, bases) = around_->gram;
  if (own_.cols() > 0) {
    Eigen::MatrixXd gram = squared(own_);
    for (Eigen::Index k = 0; k < gram.rows(); ++k) gram(k, k) += numerics.signatures.prior * (1 + gram(k, k));
    const Eigen::MatrixXd both = own_.transpose() * base();
    normal.bottomRightCorner(own_.cols(), own_.cols()) = gram;
    normal.bottomLeftCorner(own_.cols(), bases) = both;
    normal.topRightCorner(bases, own_.cols()) = both.transpose();
  }
  normal_.compute(normal);
  Eigen::VectorXd pull = along(residual_);
  pull.head(bases) -= fit.calibration;
  pulled_ = normal_.solve(pull);
}

template <class Matrix>
Eigen::MatrixXd ResidualProjection::along(const Matrix& columns) const {
  Eigen::MatrixXd products(base().cols() + own_.cols(), columns.cols());
  products.topRows(base().cols()).noalias() = base().transpose() * columns;
  if (own_.cols() > 0) products.bottomRows(own_.cols()).noalias() = own_.transpose() * columns;
  return products;
}

ResidualProjection::Products::Products(const ResidualProjection& by, const Columns& columns)
    : columns_(columns),
      cross_(by.along(columns)),
      solved_(by.normal_.solve(cross_)),
      toward_(columns.transpose() * by.residual_ - cross_.transpose() * by.pulled_) {}

Eigen::MatrixXd ResidualProjection::Products::gram(Eigen::Index first, Eigen::Index count, Eigen::Index other,
                                                   Eigen::Index others) const {
  return columns_.middleCols(first, count).transpose() * columns_.middleCols(other, others) -
         cross_.middleCols(first, count).transpose() * solved_.middleCols(other, others);
}

}  // namespace bms::diagnosis
