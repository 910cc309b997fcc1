#include "identification/variable_projection.hpp"

#include <Eigen/QR>

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// The columns of the linear unknowns.
Eigen::ColPivHouseholderQR<MatrixXd> factors_of(const MatrixXd& jacobian, Index first) {
  return jacobian.rightCols(jacobian.cols() - first).colPivHouseholderQr();
}

}  // namespace

LeastSquares with_others_at_their_best(const LeastSquares& whole, const VectorXd& start, Index first) {
  LeastSquares p;
  const auto head = [first](const VectorXd& v) { return VectorXd(v.head(std::min(first, v.size()))); };
  p.lower = head(whole.lower);
  p.upper = head(whole.upper);
  p.scale = head(whole.scale);
  p.evaluate = [evaluate = whole.evaluate, start, first](const VectorXd& x, VectorXd& r, MatrixXd* jacobian) {
    VectorXd all = start;
    all.head(first) = x;
    MatrixXd of_all;
    if (!evaluate(all, r, &of_all)) return false;
    const auto factors = factors_of(of_all, first);
    const VectorXd step = factors.solve(-r);
    r += of_all.rightCols(step.size()) * step;
    if (jacobian == nullptr) return r.allFinite();
    all.tail(step.size()) += step;
    VectorXd again;
    if (!evaluate(all, again, &of_all)) return false;
    // what the linear unknowns can follow changes nothing
    *jacobian = of_all.leftCols(first);
    jacobian->applyOnTheLeft(factors.householderQ().transpose());
    jacobian->topRows(factors.rank()).setZero();
    jacobian->applyOnTheLeft(factors.householderQ());
    return r.allFinite() && jacobian->allFinite();
  };
  return p;
}

VectorXd best_others(const LeastSquares& whole, VectorXd x, Index first) {
  VectorXd r;
  MatrixXd jacobian;
  if (whole.evaluate(x, r, &jacobian)) x.tail(x.size() - first) -= factors_of(jacobian, first).solve(r);
  return x;
}

}  // namespace bms::identification
