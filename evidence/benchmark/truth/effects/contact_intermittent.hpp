// A contact that opens in bursts of 1 to 60 s (two states with exponential dwell times), each burst with its own
// resistance, which has a power-law tail. Amplitude: scale of the resistance [ohm]; the mean burst is about 1.
#pragma once

#include <algorithm>
#include <cmath>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

struct BurstOptions {
  std::uint64_t seed;
  std::size_t count;  ///< samples
  double step_s;
  double between_s, dwell_s;  ///< mean time between two bursts, mean duration of a burst
};

/// Relative resistance of each sample.
inline std::vector<double> contact_bursts(const BurstOptions& o) {
  plant::Random random(o.seed);
  std::vector<double> ohm(o.count, 0.0);
  double until_s = -o.between_s * std::log(1 - random.uniform());
  bool loose = false;
  double size = 0;
  for (std::size_t k = 0; k < o.count; ++k) {
    while (static_cast<double>(k) * o.step_s >= until_s) {
      loose = !loose;
      const double dwell = loose ? std::clamp(-o.dwell_s * std::log(1 - random.uniform()), 1.0, 60.0)
                                 : -o.between_s * std::log(1 - random.uniform());
      until_s += std::max(dwell, o.step_s);
      if (loose) size = std::min(0.5 * std::pow(1 - random.uniform(), -1 / 2.2), 5.0);
    }
    if (loose) ohm[k] = size * (0.7 + 0.6 * random.uniform());
  }
  return ohm;
}

inline DrawnEffect draw_contact_intermittent(const EffectDraw& draw) {
  const double between_s = log_between(draw.random, 120, 1'200), dwell_s = log_between(draw.random, 3, 30);
  const std::uint64_t seed = draw.seed;
  return {0.02 * draw.r0_ohm, 1.5 * draw.r0_ohm, [=](double resistance_ohm, World& w) {
            w.cell.contact_scale = resistance_ohm;
            w.cell.contact_ohm = contact_bursts({.seed = EffectDraw::series_seed(seed, w),
                                                 .count = w.stimulus.current_a.size(),
                                                 .step_s = w.stimulus.step_s,
                                                 .between_s = between_s,
                                                 .dwell_s = dwell_s});
          }};
}

inline constexpr EffectKind contact_intermittent = {
    .id = "contact_intermittent",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::drive_two_way, Profile::forklift_shift, Profile::drive_discharge, Profile::hppc}};
        },
    .draw = draw_contact_intermittent,
    .repeats_in_holdout = false,
};

}  // namespace bms::benchmark::truth::effects
