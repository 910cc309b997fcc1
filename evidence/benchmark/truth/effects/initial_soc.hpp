// The initial SOC given to the diagnosis is wrong. Amplitude: the error in SOC.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_initial_soc(const EffectDraw& draw) {
  const double room = draw.direction > 0 ? 0.99 - draw.world.start_soc : draw.world.start_soc - 0.01;
  const double direction = room < 0.06 ? -draw.direction : draw.direction;
  return {0.006, 0.15, [=](double error, World& w) {
            if (!w.holdout) w.given_soc_error = direction * error;
          }};
}

inline constexpr EffectKind initial_soc = {
    .id = "initial_soc",
    .acts_on = ActsOn::start,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::full_cycle, Profile::hppc, Profile::drive_discharge, Profile::storage}};
        },
    .draw = draw_initial_soc,
};

}  // namespace bms::benchmark::truth::effects
