// Outside the catalogue: a bump of the OCV where an earlier partial cycle turned. Amplitude: its height [V].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_memory_bump(const EffectDraw& draw) {
  const Memory m = {
      .bump_v = 0, .turned_at = between(draw.random, 0.3, 0.75), .width = between(draw.random, 0.015, 0.05)};
  const double direction = draw.direction;
  return {0.001, 0.02, [=](double height_v, World& w) {
            w.cell.memory = m;
            w.cell.memory.bump_v = direction * height_v;
          }};
}

inline constexpr EffectKind memory_bump = {
    .id = "memory_bump",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::hppc, Profile::full_cycle, Profile::storage}};
        },
    .draw = draw_memory_bump,
    // A function of the SOC until a charge removes it.
    .laws = {"ocv"},
};

}  // namespace bms::benchmark::truth::effects
