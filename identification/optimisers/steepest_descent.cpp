// Steepest descent in the scaled unknowns, projected onto the bounds.
#include <Eigen/Core>

#include "identification/optimisers/methods.hpp"

namespace bms::identification {

namespace {

using Eigen::VectorXd;

struct Trial {
  VectorXd x;
  double cost = 0;
  bool sufficient = false;
};

Trial try_length(Search& search, const VectorXd& direction, double length) {
  const VectorXd step = (length * direction).cwiseMax(search.below()).cwiseMin(search.above());
  Trial trial{search.after(step), 0, false};
  trial.cost = search.cost_at(trial.x);
  trial.sufficient = trial.cost < search.cost() + sufficient_decrease * search.gradient().dot(step);
  return trial;
}

}  // namespace

void search_steepest_descent(Search& search) {
  constexpr int most_halvings = 60, most_doublings = 20;
  while (!search.settled()) {
    VectorXd direction = VectorXd::Zero(search.size());
    for (const Eigen::Index i : search.free()) direction[i] = -search.gradient()[i];
    const double curvature = (search.factor() * direction).squaredNorm();
    double length = curvature > 0 ? direction.squaredNorm() / curvature : 1;  // the best one if r were linear

    Trial best = try_length(search, direction, length);
    if (best.sufficient) {
      for (int k = 0; k < most_doublings; ++k) {
        const Trial longer = try_length(search, direction, length *= 2);
        if (!longer.sufficient || !(longer.cost < best.cost)) break;
        best = longer;
      }
    }
    for (int k = 0; k < most_halvings && !best.sufficient; ++k) best = try_length(search, direction, length /= 2);
    if (!best.sufficient || !search.move_to(best.x)) search.stuck();
  }
}

}  // namespace bms::identification
