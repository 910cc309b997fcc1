// How much columns could still explain of a fit's residual while the base parameters and all estimated parameters
// follow: both are projected out.
#pragma once

#include <memory>

#include <Eigen/Cholesky>

#include "diagnosis/likelihood_model.hpp"

namespace bms::diagnosis {

class ResidualProjection {
 public:
  /// Whitened by the likelihood's noise model, as the fit's residual is.
  ResidualProjection(const LikelihoodModel& likelihood, const HypothesisFit& fit);

  /// To first order, strengths x of the columns lower the cost by 2 x'toward - x'gram x.
  class Products {
   public:
    Products(const ResidualProjection& by, const Columns& columns);

    const Eigen::VectorXd& toward() const { return toward_; }
    /// Of `count` neighbouring columns.
    Eigen::MatrixXd gram(Eigen::Index first, Eigen::Index count) const {
      return gram_.block(first, first, count, count);
    }
    /// The residual with strengths of `count` neighbouring columns, the known parameters following: to first order.
    Eigen::VectorXd residual_with(Eigen::Index first, const Eigen::VectorXd& strengths) const;
    /// Of these columns (rows of the result) and others.
    Eigen::MatrixXd with(const Products& other) const;

   private:
    const ResidualProjection* by_;
    const Columns* columns_;
    Eigen::MatrixXd cross_, solved_;  ///< known columns' products with them, and the known parameters that follow
    Eigen::MatrixXd gram_;
    Eigen::VectorXd toward_;
  };
  /// columns: white, LikelihoodModel::samples() rows; they must outlive the result.
  Products of(const Columns& columns) const { return {*this, columns}; }

 private:
  const Columns& base() const { return around_->columns; }
  /// Products of the known columns with others: by the base parameters, then by the estimated parameters.
  Eigen::MatrixXd along(const Columns& columns) const;

  Eigen::VectorXd residual_;
  std::shared_ptr<const LikelihoodModel::Linearisation> around_;
  Columns own_;                          ///< derivatives by the estimated parameters
  Eigen::LDLT<Eigen::MatrixXd> normal_;  ///< known' known plus priors
  Eigen::VectorXd pulled_;               ///< step of the known parameters alone
};

}  // namespace bms::diagnosis
