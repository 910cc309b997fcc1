// The steps between the plateaus of the OCV move and stretch; both ends stay. Amplitude: the movement in SOC.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_ocv_shape(const EffectDraw& draw) {
  const double tilt = between(draw.random, -0.6, 0.6), direction = draw.direction;
  return {0.003, 0.08,
          [=](double slide, World& w) { w.cell.plateau_slide = {.slide = direction * slide, .tilt = tilt}; }};
}

inline constexpr EffectKind ocv_shape = {
    .id = "ocv_shape",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::full_cycle, Profile::hppc, Profile::storage}};
        },
    .draw = draw_ocv_shape,
};

}  // namespace bms::benchmark::truth::effects
