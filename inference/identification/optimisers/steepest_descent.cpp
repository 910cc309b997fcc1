// Steepest descent in the scaled unknowns, projected onto the bounds.
#include <Eigen/Core>

#include "identification/optimisers/optimisation.hpp"

namespace bms::identification {

namespace {

using Eigen::VectorXd;

struct Trial {
  VectorXd x;
  double cost = 0;
  bool sufficient = false;
};

Trial try_length(Optimisation& run, const VectorXd& direction, double length) {
  const VectorXd step = (length * direction).cwiseMax(run.below()).cwiseMin(run.above());
  Trial trial{run.after(step), 0, false};
  trial.cost = run.cost_at(trial.x);
  trial.sufficient = trial.cost < run.cost() + sufficient_decrease * run.gradient().dot(step);
  return trial;
}

}  // namespace

void search_steepest_descent(Optimisation& run) {
  constexpr int most_halvings = 60, most_doublings = 20;
  while (!run.finished()) {
    VectorXd direction = VectorXd::Zero(run.size());
    for (const Eigen::Index i : run.free()) direction[i] = -run.gradient()[i];
    const double curvature = (run.factor() * direction).squaredNorm();
    double length = curvature > 0 ? direction.squaredNorm() / curvature : 1;  // the best length for a linear r

    Trial best = try_length(run, direction, length);
    if (best.sufficient) {
      for (int k = 0; k < most_doublings; ++k) {
        const Trial longer = try_length(run, direction, length *= 2);
        if (!longer.sufficient || !(longer.cost < best.cost)) break;
        best = longer;
      }
    }
    for (int k = 0; k < most_halvings && !best.sufficient; ++k) best = try_length(run, direction, length /= 2);
    if (!best.sufficient || !run.move_to(best.x)) run.no_decrease();
  }
}

}  // namespace bms::identification
