// The current sensor saturates, with a soft knee. Amplitude: the fraction of the largest current that is cut off.
#pragma once

#include <algorithm>
#include <cmath>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_current_clipping(const EffectDraw& draw) {
  double largest_a = 0;
  for (const double i : draw.world.stimulus.current_a) largest_a = std::max(largest_a, std::abs(i));
  const double knee = between(draw.random, 8, 16);
  return {0.1, 0.6, [=](double cut, World& w) {
            w.faults.current.saturates_a = (1 - cut) * largest_a;
            w.faults.current.knee = knee;
          }};
}

inline constexpr EffectKind current_clipping = {
    .id = "current_clipping",
    .acts_on = ActsOn::current,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::drive_two_way, Profile::multi_rate, Profile::forklift_shift},
                            .current_scale = 1.3};
        },
    .draw = draw_current_clipping,
};

}  // namespace bms::benchmark::truth::effects
