// Three RC elements around one time constant below that of the cell's own. Amplitude: their resistance [ohm].
#pragma once

#include <algorithm>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_fast_polarisation(const EffectDraw& draw) {
  const double fastest_s = std::max(0.5, draw.world.stimulus.step_s);
  const double slowest_s = std::max(0.3 * draw.tau_s, 1.5 * fastest_s);
  const FastElement f = {.resistance_ohm = 0,
                         .time_s = log_between(draw.random, fastest_s, slowest_s),
                         .spread = between(draw.random, 2, 3)};
  return {0.02 * draw.r0_ohm, 0.8 * draw.r0_ohm, [f](double resistance_ohm, World& w) {
            w.cell.fast = f;
            w.cell.fast.resistance_ohm = resistance_ohm;
          }};
}

inline constexpr EffectKind fast_polarisation = {
    .id = "fast_polarisation",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::hppc, Profile::multi_rate, Profile::drive_two_way}, .step_s = 0.5};
        },
    .draw = draw_fast_polarisation,
};

}  // namespace bms::benchmark::truth::effects
