// Gauss-Newton in a subspace: `gn` after Ljung's System Identification Toolbox, `agn` after Wills & Ninness, "On
// Gradient-Based Search for Multivariable System Estimates", IEEE Trans. Automatic Control 53 (2008).
#include <algorithm>
#include <limits>

#include <Eigen/SVD>

#include "identification/optimisers/methods.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_bisections = 10;  // a step still too long then says that J has lost rank

VectorXd subspace_step(const MatrixXd& a, const VectorXd& b, double tolerance) {
  const Eigen::BDCSVD<MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd& values = svd.singularValues();
  const VectorXd along = svd.matrixU().transpose() * b;
  VectorXd p = VectorXd::Zero(a.cols());
  for (Index k = 0; k < values.size() && values[k] > tolerance * values[0]; ++k)
    p -= svd.matrixV().col(k) * (along[k] / values[k]);
  return p;
}

VectorXd subspace_step(const Search& search, double tolerance) {
  return step_within_bounds(
      search, [&](const MatrixXd& a, const VectorXd& b, const Indices&) { return subspace_step(a, b, tolerance); });
}

/// Bisections that were needed, more than most_bisections if in vain.
int move_along(Search& search, const VectorXd& step) {
  const double slope = search.gradient().dot(step);
  double length = 1;
  for (int bisections = 0; bisections <= most_bisections; ++bisections, length /= 2) {
    const VectorXd x = search.after(length * step);
    if (search.cost_at(x) < search.cost() + sufficient_decrease * length * slope && search.move_to(x))
      return bisections;
  }
  return most_bisections + 1;
}

/// The last resort where J has lost rank and its step leads too far: down the gradient, columns of J brought to one
/// length.
bool move_down_gradient(Search& search) {
  VectorXd step = VectorXd::Zero(search.size());
  for (const Index i : search.free())
    step[i] = -search.gradient()[i] / (search.column_norms()[i] * search.column_norms()[i]);
  const double curvature = (search.factor() * step).squaredNorm();
  if (curvature > 0) step *= -search.gradient().dot(step) / curvature;
  return move_along(search, step.cwiseMax(search.below()).cwiseMin(search.above())) <= most_bisections;
}

}  // namespace

void search_gauss_newton(Search& search) {
  // what the toolbox leaves out, GnPinvConst = 1e4
  const double tolerance =
      1e4 * static_cast<double>(std::max(search.rows(), search.size())) * std::numeric_limits<double>::epsilon();
  while (!search.settled()) {
    if (move_along(search, subspace_step(search, tolerance)) > most_bisections && !move_down_gradient(search))
      search.stuck();
  }
}

void search_adaptive_gauss_newton(Search& search) {
  // The paper's are for the eigenvalues of J'J: start 1e-4, up by 2, down by 4. Here their roots.
  constexpr double start = 1e-2, up = 1.4142135623730951, down = 2, smallest = 1e-12, largest = 0.5;
  double gamma = start;
  bool in_vain = false;  // the last search, in a larger subspace
  while (!search.settled()) {
    const VectorXd step = subspace_step(search, gamma);
    const bool exhausted =
        -search.expected_change(step) <= search.stopping().cost * search.cost();  // nothing left in this subspace
    if ((exhausted && (in_vain || gamma <= smallest)) || (in_vain && gamma >= largest)) {
      if (!move_down_gradient(search)) search.stuck();
      in_vain = false;
      continue;
    }
    const int bisections = exhausted ? 0 : move_along(search, step);
    in_vain = bisections > most_bisections;
    gamma = bisections == 0 ? std::max(gamma / down, smallest) : std::min(gamma * (in_vain ? 8 : up), largest);
  }
}

}  // namespace bms::identification
