#include "diagnosis/pack/noise_search.hpp"

#include "diagnosis/pack/pack_thresholds.hpp"

namespace bms::diagnosis::pack {

namespace {

constexpr const PackThresholds::Noise& of_noise = limits.noise;

bool is_allowed(const NoiseModel& tried, double NoiseModel::*part, std::span<const double> time_s) {
  if (part == &NoiseModel::slow_s)
    return tried.slow_s >= 2 * tried.fast_s && tried.slow_s <= time_s.back() - time_s.front();
  return part == &NoiseModel::edge || (tried.*part >= of_noise.least_v && tried.*part <= of_noise.most_v);
}

}  // namespace

NoiseModel search_noise(const NoiseModel& start, std::span<const double> time_s,
                        const std::function<double(const NoiseModel&)>& cost_of) {
  NoiseModel best = start;
  double cost = cost_of(best);
  for (const double factor : of_noise.factors) {
    for (bool moved = true; moved;) {
      moved = false;
      for (double NoiseModel::*part :
           {&NoiseModel::white_v, &NoiseModel::fast_v, &NoiseModel::slow_v, &NoiseModel::edge, &NoiseModel::slow_s}) {
        for (const double by : {factor, 1 / factor}) {
          NoiseModel tried = best;
          tried.*part *= by;
          if (!is_allowed(tried, part, time_s)) continue;
          const double tried_cost = cost_of(tried);
          if (!(tried_cost < cost - limits.fit.converged)) continue;  // also ends where a cost is NaN
          cost = tried_cost;
          best = tried;
          moved = true;
        }
      }
    }
  }
  return best;
}

}  // namespace bms::diagnosis::pack
