// A smooth temperature coefficient of the OCV that changes its sign over SOC. Amplitude: its scale [V/K].
#pragma once

#include <cmath>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline Experiment experiment_of_entropic_ocv(plant::Random& random) {
  const double colder_k = -between(random, 15, 22);
  const double warmer_k = between(random, 15, 22);
  return {.profiles = {Profile::minor_loops, Profile::full_cycle, Profile::hppc, Profile::storage},
          .swing_k = chance(random, 0.5) ? warmer_k : colder_k};
}

inline DrawnEffect draw_entropic_ocv(const EffectDraw& draw) {
  const double crosses = between(draw.random, 0.3, 0.7), swing = between(draw.random, 0.15, 0.3);
  const SmoothRandom wave(draw.random);
  const Curve curve([&](double z) { return draw.direction * (std::tanh((z - crosses) / swing) + 0.3 * wave.at(z)); });
  return {0.00002, 0.0006, [curve](double scale_v_per_k, World& w) {
            w.cell.entropy_v_per_k = curve;
            w.cell.entropy_scale = scale_v_per_k;
          }};
}

inline constexpr EffectKind entropic_ocv = {
    .id = "entropic_ocv",
    .acts_on = ActsOn::cell,
    .experiment = experiment_of_entropic_ocv,
    .draw = draw_entropic_ocv,
    .needs_temperature = true,
};

}  // namespace bms::benchmark::truth::effects
