#include "diagnosis/sensor_end.hpp"

#include <algorithm>
#include <cmath>

#include "diagnosis/noise.hpp"
#include "diagnosis/numerics.hpp"
#include "diagnosis/thresholds.hpp"
#include "measurement/statistics.hpp"

namespace bms::diagnosis {

bool SensorEnd::stands(double current_a) const {
  return std::abs(current_a) >= (1 - thresholds.facts.stands_within) * limit_a;
}

SensorEnd sensor_end(const PreparedRecording& r, double quiet_a, double noise_v) {
  SensorEnd end;
  for (const double a : r.current_a) {
    if (std::isfinite(a)) end.limit_a = std::max(end.limit_a, std::abs(a));
  }
  // second differences, without the first row of a visit: under a constant current the voltage relaxes, and bends
  // little
  measurement::MeanSquare bends;
  std::size_t rows = 0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    const bool same_side = k > 0 && r.current_a[k] * r.current_a[k - 1] > 0, stands = end.stands(r.current_a[k]);
    if (!same_side || !stands) rows = 0;
    if (!stands || ++rows <= thresholds.facts.stands_before) continue;
    const double bend_v = r.voltage_v[k] - 2 * r.voltage_v[k - 1] + r.voltage_v[k - 2];
    if (std::isfinite(bend_v)) bends.add(bend_v);
  }
  if (bends.count() < thresholds.facts.stands_rows) return end;
  const double moved_v = bends.root() / std::sqrt(numerics.statistics.second_difference_variance),
               still_v = thresholds.facts.stands_noise * white_noise(r.voltage_v, r.current_a, quiet_a, noise_v);
  if (moved_v > still_v) end.spread_v = moved_v;
  return end;
}

}  // namespace bms::diagnosis
