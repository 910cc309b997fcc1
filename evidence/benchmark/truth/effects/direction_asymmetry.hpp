// R0 and R1 depend on the direction of the current, with a smooth transition around zero. Amplitude: relative excess
// while charging.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_direction_asymmetry(const EffectDraw& draw) {
  const double width_a = between(draw.random, 0.05, 0.3) * draw.one_c_a;
  const double direction = draw.direction;
  return {0.02, 0.35,
          [=](double excess, World& w) { w.cell.asymmetry = {.excess = direction * excess, .width_a = width_a}; }};
}

inline constexpr EffectKind direction_asymmetry = {
    .id = "direction_asymmetry",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::drive_two_way, Profile::minor_loops, Profile::multi_rate, Profile::hppc}};
        },
    .draw = draw_direction_asymmetry,
};

}  // namespace bms::benchmark::truth::effects
