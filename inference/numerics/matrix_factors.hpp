// Factors of dense matrices. Each takes 5 to 15 s to compile inside Eigen, so they are compiled once, here.
#pragma once

#include <Eigen/Core>

namespace bms::numerics {

/// A = U diag(values) V', as many columns as A has rows or columns, whichever is less; values in descending order.
struct ThinSvd {
  Eigen::MatrixXd u;
  Eigen::VectorXd values;
  Eigen::MatrixXd v;
};
ThinSvd thin_svd(const Eigen::MatrixXd& a);

/// The x that minimises |A x - b|, by QR with column pivoting. Columns whose pivot is at most `dependent` times the
/// largest are left out; 0: below rounding.
Eigen::VectorXd solve_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double dependent = 0);

/// Of all x that minimise |A x - b| the shortest: where columns of A depend on each other, all of them take a share.
Eigen::VectorXd shortest_least_squares(const Eigen::MatrixXd& a, const Eigen::VectorXd& b);

/// Moore-Penrose inverse.
Eigen::MatrixXd pseudo_inverse(const Eigen::MatrixXd& a);

}  // namespace bms::numerics
