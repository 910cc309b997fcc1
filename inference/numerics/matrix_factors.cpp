#include "numerics/matrix_factors.hpp"

#include <Eigen/QR>
#include <Eigen/SVD>

namespace bms::numerics {

ThinSvd thin_svd(const Eigen::MatrixXd& a) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

Eigen::VectorXd solve_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double dependent) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr;
  if (dependent > 0) qr.setThreshold(dependent);
  qr.compute(a);
  return qr.solve(b);
}

Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b) {
  return a.completeOrthogonalDecomposition().solve(b);
}

Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& a) { return a.completeOrthogonalDecomposition().pseudoInverse(); }

}  // namespace bms::numerics
