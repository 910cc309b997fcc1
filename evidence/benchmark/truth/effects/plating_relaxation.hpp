// Outside the catalogue: an electrode state that fills while charging and holds the voltage up for 20 to 60 min
// afterwards. Amplitude: the voltage of that plateau [V].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_plating_relaxation(const EffectDraw& draw) {
  const Plating p = {.plateau_v = 0,
                     .hold_s = between(draw.random, 1'200, 3'600),
                     .fill_s = between(draw.random, 400, 1'500),
                     .least_a = between(draw.random, 0.15, 0.3) * draw.one_c_a};
  return {0.001, 0.02, [p](double plateau_v, World& w) {
            w.cell.plating = p;
            w.cell.plating.plateau_v = plateau_v;
          }};
}

inline constexpr EffectKind plating_relaxation = {
    .id = "plating_relaxation",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::full_cycle, Profile::minor_loops, Profile::storage, Profile::many_cycles}};
        },
    .draw = draw_plating_relaxation,
    // A voltage that follows the charging current within 400 to 3,600 s and then decays.
    .laws = {"slow"},
};

}  // namespace bms::benchmark::truth::effects
