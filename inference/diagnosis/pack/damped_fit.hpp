// Gauss-Newton with steps that are halved until the cost falls.
#pragma once

#include <utility>

#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

/// best: linearised at the member `place`, with its cost. around(place): the same there; normal(fit): matrix of the
/// normal equations; target(fit): the place that is best if the model is linear. Ends after `iterations`, or when the
/// cost falls, or is expected to fall, by less than limits.fit.converged.
template <class Fit, class Place, class Around, class Normal, class Target>
Fit damped_fit(Fit best, Place Fit::*place, int iterations, const Around& around, const Normal& normal,
               const Target& target) {
  for (int i = 0; i < iterations; ++i) {
    const Place step = target(best) - best.*place;
    if (step.dot(normal(best) * step) < limits.fit.converged) break;
    const double before = best.cost;
    double share = 1;
    bool better = false;
    for (int h = 0; h <= limits.fit.halvings && !better; ++h, share /= 2) {
      Fit next = around(best.*place + share * step);
      better = next.cost < best.cost;
      if (better) best = std::move(next);
    }
    if (!better || before - best.cost < limits.fit.converged) break;
  }
  return best;
}

}  // namespace bms::diagnosis::pack
