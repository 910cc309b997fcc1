// Gauss-Newton with steps that are halved until the cost falls.
#pragma once

#include <optional>
#include <utility>

#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

/// A fit at another place, and by how much its cost is less there.
template <class Fit>
struct Improved {
  Fit fit;
  double gain;
};

/// `next`, if its cost is less than that of `best`.
template <class Fit>
std::optional<Improved<Fit>> if_less(const Fit& best, Fit next) {
  const double gain = best.cost - next.cost;
  if (!(gain > 0)) return std::nullopt;
  return Improved<Fit>{std::move(next), gain};
}

/// best: linearised at the member `place`. improved(best, place): the fit there, or nothing if its cost is not less.
/// normal(fit): matrix of the normal equations; target(fit): the place that is best if the model is linear. Ends after
/// `iterations`, or when the cost falls, or is expected to fall, by less than limits.fit.converged.
template <class Fit, class Place, class Improve, class Normal, class Target>
Fit damped_fit(Fit best, Place Fit::*place, int iterations, const Improve& improved, const Normal& normal,
               const Target& target) {
  for (int i = 0; i < iterations; ++i) {
    const Place step = target(best) - best.*place;
    if (step.dot(normal(best) * step) < limits.fit.converged) break;
    std::optional<Improved<Fit>> next;
    double share = 1;
    for (int h = 0; h <= limits.fit.halvings && !next; ++h, share /= 2)
      next = improved(best, best.*place + share * step);
    if (!next) break;
    best = std::move(next->fit);
    if (next->gain < limits.fit.converged) break;
  }
  return best;
}

}  // namespace bms::diagnosis::pack
