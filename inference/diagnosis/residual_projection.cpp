#include "diagnosis/residual_projection.hpp"

#include "diagnosis/numerics.hpp"
#include "diagnosis/products.hpp"

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
    const Eigen::MatrixXd both = products(own_, base());
    normal.bottomRightCorner(own_.cols(), own_.cols()) = gram;
    normal.bottomLeftCorner(own_.cols(), bases) = both;
    normal.topRightCorner(bases, own_.cols()) = both.transpose();
  }
  normal_.compute(normal);
  Eigen::VectorXd pull(all);
  pull << base().transpose() * residual_ - fit.calibration, own_.transpose() * residual_;
  pulled_ = normal_.solve(pull);
}

Eigen::MatrixXd ResidualProjection::along(const Columns& columns) const {
  Eigen::MatrixXd both(base().cols() + own_.cols(), columns.cols());
  both.topRows(base().cols()) = products(base(), columns);
  if (own_.cols() > 0) both.bottomRows(own_.cols()) = products(own_, columns);
  return both;
}

ResidualProjection::Products::Products(const ResidualProjection& by, const Columns& columns)
    : by_(&by),
      columns_(&columns),
      cross_(by.along(columns)),
      solved_(by.normal_.solve(cross_)),
      gram_(squared(columns) - cross_.transpose() * solved_),
      toward_(columns.transpose() * by.residual_ - cross_.transpose() * by.pulled_) {}

Eigen::VectorXd ResidualProjection::Products::residual_with(Eigen::Index first,
                                                            const Eigen::VectorXd& strengths) const {
  const Eigen::VectorXd known = by_->pulled_ - solved_.middleCols(first, strengths.size()) * strengths;
  const Eigen::Index bases = by_->base().cols();
  Eigen::VectorXd left =
      by_->residual_ - by_->base() * known.head(bases) - columns_->middleCols(first, strengths.size()) * strengths;
  if (by_->own_.cols() > 0) left -= by_->own_ * known.tail(by_->own_.cols());
  return left;
}

Eigen::MatrixXd ResidualProjection::Products::with(const Products& other) const {
  return products(*columns_, *other.columns_) - cross_.transpose() * other.solved_;
}

}  // namespace bms::diagnosis
