#include "linear_algebra/symmetric_eigen.hpp"

#include <Eigen/Eigenvalues>

namespace bms::linear_algebra {

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

}  // namespace bms::linear_algebra
