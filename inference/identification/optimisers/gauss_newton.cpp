// Gauss-Newton in a subspace: `gn` after Ljung's System Identification Toolbox, `agn` after Wills & Ninness, "On
// Gradient-Based Search for Multivariable System Estimates", IEEE Trans. Automatic Control 53 (2008).
#include <algorithm>
#include <limits>

#include "identification/optimisers/optimisation.hpp"
#include "numerics/matrix_factors.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_bisections = 25;  // MaxBisections of the toolbox

VectorXd subspace_step(const MatrixXd& a, const VectorXd& b, double tolerance) {
  const auto [u, values, v] = numerics::thin_svd(a);
  const VectorXd along = u.transpose() * b;
  VectorXd p = VectorXd::Zero(a.cols());
  for (Index k = 0; k < values.size() && values[k] > tolerance * values[0]; ++k) p -= v.col(k) * (along[k] / values[k]);
  return p;
}

VectorXd subspace_step(const Optimisation& run, double tolerance) {
  return step_within_bounds(
      run, [&](const MatrixXd& a, const VectorXd& b, const Indices&) { return subspace_step(a, b, tolerance); });
}

/// Number of bisections; more than most_bisections if no smaller cost was found.
int move_along(Optimisation& run, const VectorXd& step) {
  const double slope = run.gradient().dot(step);
  double length = 1;
  for (int bisections = 0; bisections <= most_bisections; ++bisections, length /= 2) {
    const VectorXd x = run.after(length * step);
    if (run.cost_at(x) < run.cost() + sufficient_decrease * length * slope && run.move_to(x)) return bisections;
  }
  return most_bisections + 1;
}

/// For a J that has lost rank and gives a step that is too long: a step along the negative gradient, with the columns
/// of J scaled to one length.
bool move_down_gradient(Optimisation& run) {
  VectorXd step = VectorXd::Zero(run.size());
  for (const Index i : run.free()) step[i] = -run.gradient()[i] / (run.column_norms()[i] * run.column_norms()[i]);
  const double curvature = (run.factor() * step).squaredNorm();
  if (curvature > 0) step *= -run.gradient().dot(step) / curvature;
  return move_along(run, step.cwiseMax(run.below()).cwiseMin(run.above())) <= most_bisections;
}

/// The tolerance of the toolbox, GnPinvConst = 1e4.
double pseudo_inverse_tolerance(const Optimisation& run) {
  constexpr double gn_pinv_const = 1e4;
  return gn_pinv_const * static_cast<double>(std::max(run.rows(), run.size())) * std::numeric_limits<double>::epsilon();
}

}  // namespace

bool move_undamped(Optimisation& run) {
  return move_along(run, subspace_step(run, pseudo_inverse_tolerance(run))) <= most_bisections;
}

void search_gauss_newton(Optimisation& run) {
  while (!run.finished()) {
    if (!move_undamped(run) && !move_down_gradient(run)) run.no_decrease();
  }
}

void search_adaptive_gauss_newton(Optimisation& run) {
  // The toolbox compares eigenvalues of J'J: start 1e-4 (InitialGnaTolerance), up by 2 (LMStep) when no smaller cost
  // was found in fewer than five bisections, down by 4 when the first step already found one. Here: the roots of all
  // three.
  constexpr double start = 1e-2, up = 1.4142135623730951, down = 2, smallest = 1e-12, largest = 0.5;
  constexpr double up_in_vain = 8;  // after a line search without any smaller cost, which the toolbox would end with
  constexpr int many_bisections = 5;
  double gamma = start;
  bool in_vain = false;  // the last line search failed in a larger subspace
  while (!run.finished()) {
    const VectorXd step = subspace_step(run, gamma);
    const bool exhausted =
        -run.expected_change(step) <= run.stopping().cost * run.cost();  // no further decrease in this subspace
    if ((exhausted && (in_vain || gamma <= smallest)) || (in_vain && gamma >= largest)) {
      if (!move_down_gradient(run) && !move_undamped(run)) run.no_decrease();
      in_vain = false;
      continue;
    }
    const int bisections = exhausted ? 0 : move_along(run, step);
    in_vain = bisections > most_bisections;
    if (bisections == 0) gamma = std::max(gamma / down, smallest);
    if (bisections >= many_bisections) gamma = std::min(gamma * (in_vain ? up_in_vain : up), largest);
  }
}

}  // namespace bms::identification
