// Eigenvalues of a symmetric matrix. They take 5 s to compile inside Eigen, so this is done once.
#pragma once

#include <Eigen/Core>

namespace bms::numerics {

/// A = vectors diag(values) vectors', values in ascending order.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a);

}  // namespace bms::numerics
