// Diffusion into a slab of 1,200 to 12,000 s (thickness squared by diffusivity). Amplitude: its steady-state resistance
// [ohm].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_slow_polarisation(const EffectDraw& draw) {
  // the slab relaxes within time_s / 10
  const Diffusion d = {.resistance_ohm = 0, .time_s = log_between(draw.random, 1'200, 12'000), .lag_s = 2 * draw.tau_s};
  return {0.0003 / draw.capacity_ratio, 0.012 / draw.capacity_ratio, [d](double resistance_ohm, World& w) {
            w.cell.diffusion = d;
            w.cell.diffusion.resistance_ohm = resistance_ohm;
          }};
}

inline constexpr EffectKind slow_polarisation = {
    .id = "slow_polarisation",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::hppc, Profile::minor_loops, Profile::full_cycle}};
        },
    .draw = draw_slow_polarisation,
};

}  // namespace bms::benchmark::truth::effects
