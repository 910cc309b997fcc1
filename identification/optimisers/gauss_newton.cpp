// Gauss-Newton in a subspace: `gn` after Ljung's System Identification Toolbox, `agn` after Wills & Ninness, "On Gradient-Based
// Search for Multivariable System Estimates", IEEE Trans. Automatic Control 53 (2008).
#include <algorithm>
#include <limits>

#include <Eigen/SVD>

#include "identification/optimisers/methods.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_bisections = 25;
constexpr double sufficient = 1e-4;  // part of the linear decrease that must be reached (Armijo)

VectorXd subspace_step(const MatrixXd& a, const VectorXd& b, double tolerance) {
  const Eigen::BDCSVD<MatrixXd> svd(a, Eigen::ComputeThinU | Eigen::ComputeThinV);
  const VectorXd& values = svd.singularValues();
  const VectorXd along = svd.matrixU().transpose() * b;
  VectorXd p = VectorXd::Zero(a.cols());
  for (Index k = 0; k < values.size() && values[k] > tolerance * values[0]; ++k) p -= svd.matrixV().col(k) * (along[k] / values[k]);
  return p;
}

VectorXd subspace_step(const Search& search, double tolerance) {
  return step_within_bounds(search, [&](const MatrixXd& a, const VectorXd& b, const Indices&) { return subspace_step(a, b, tolerance); });
}

/// Bisections that were needed, more than most_bisections if in vain.
int move_along(Search& search, const VectorXd& step) {
  const double slope = search.gradient().dot(step);
  double length = 1;
  for (int bisections = 0; bisections <= most_bisections; ++bisections, length /= 2) {
    const VectorXd x = search.after(length * step);
    if (search.cost_at(x) < search.cost() + sufficient * length * slope && search.move_to(x)) return bisections;
  }
  return most_bisections + 1;
}

}  // namespace

void search_gauss_newton(Search& search) {
  // what the toolbox leaves out, GnPinvConst = 1e4
  const double tolerance = 1e4 * static_cast<double>(std::max(search.rows(), search.size())) * std::numeric_limits<double>::epsilon();
  while (!search.settled()) {
    if (move_along(search, subspace_step(search, tolerance)) > most_bisections) search.stuck();
  }
}

void search_adaptive_gauss_newton(Search& search) {
  // The paper's are for the eigenvalues of J'J: start 1e-4, up by 2, down by 4. Here their roots.
  constexpr double start = 1e-2, up = 1.4142135623730951, down = 2, smallest = 1e-12;
  double gamma = start;
  while (!search.settled()) {
    const VectorXd step = subspace_step(search, gamma);
    const bool exhausted = -search.expected_change(step) <= search.stopping().cost * search.cost();  // nothing left in this subspace
    const int bisections = exhausted ? 0 : move_along(search, step);
    if (bisections == 0) {
      if (exhausted && gamma <= smallest) search.stuck();
      gamma = std::max(gamma / down, smallest);
    } else {
      if (bisections > most_bisections && gamma >= 1) search.stuck();
      gamma = std::min(gamma * up, 1.0);
    }
  }
}

}  // namespace bms::identification
