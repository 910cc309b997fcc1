#include "numerics/symmetric_eigen.hpp"

#include <Eigen/Eigenvalues>

namespace bms::numerics {

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& a) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(a);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

}  // namespace bms::numerics
