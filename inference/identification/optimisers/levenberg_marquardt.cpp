// Levenberg-Marquardt: scaling after More, "The Levenberg-Marquardt algorithm", LNM 630 (1978); damping after Nielsen,
// "Damping parameter in Marquardt's method", IMM-REP-1999-05.
#include <algorithm>
#include <cmath>

#include <Eigen/QR>

#include "identification/optimisers/optimisation.hpp"

namespace bms::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Minimises |A p + b|^2 + damping |D p|^2 by QR of both stacked.
VectorXd damped_step(const MatrixXd& a, const VectorXd& b, const VectorXd& weights, double damping) {
  const Index n = a.rows(), columns = a.cols();
  MatrixXd both = MatrixXd::Zero(n + columns, columns);
  both.topRows(n) = a;
  both.bottomRows(columns).diagonal() = std::sqrt(damping) * weights;
  VectorXd right = VectorXd::Zero(n + columns);
  right.head(n) = -b;
  return both.householderQr().solve(right);
}

}  // namespace

void search_levenberg_marquardt(Optimisation& run) {
  constexpr double largest_damping = 1e30;  // relative to J'J: the step is zero
  constexpr double start = 1e-3;
  double damping = start, raise = 2;
  while (!run.finished()) {
    const VectorXd step = step_within_bounds(run, [&](const MatrixXd& a, const VectorXd& b, const Indices& free) {
      return damped_step(a, b, run.column_norms()(free), damping);
    });
    const double before = run.cost(), expected = -run.expected_change(step);
    const VectorXd x = run.after(step);
    const double cost = run.cost_at(x);
    if (cost < before && run.move_to(x)) {
      const double gain = (before - cost) / expected;
      damping *= std::max(1.0 / 3, 1 - std::pow(2 * gain - 1, 3));
      damping = std::max(damping, 1e-30);
      raise = 2;
    } else {
      damping *= raise;
      raise *= 2;
      if (damping < largest_damping && x != run.x()) continue;
      if (!move_undamped(run)) run.no_decrease();
      damping = start;
      raise = 2;
    }
  }
}

}  // namespace bms::identification
