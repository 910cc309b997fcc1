// Outside the catalogue: pressure that follows the mean current of about an hour lifts the OCV. Amplitude: the lift [V]
// at a lasting C-rate of 0.5.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_pressure_memory(const EffectDraw& draw) {
  const double time_constant_s = between(draw.random, 2'400, 4'800), direction = draw.direction;
  return {0.001, 0.03, [=](double lift_v, World& w) {
            w.cell.pressure = {.lift_v = direction * lift_v, .time_constant_s = time_constant_s};
          }};
}

inline constexpr EffectKind pressure_memory = {
    .id = "pressure_memory",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::multi_rate, Profile::drive_two_way, Profile::many_cycles},
                            .current_scale = 1.3};
        },
    .draw = draw_pressure_memory,
    // The OCV is lifted, and how much a state says that follows the current within an hour: both are true.
    .laws = {"slow", "ocv"},
};

}  // namespace bms::benchmark::truth::effects
