// Resistances by the law of Arrhenius or of Vogel, Tammann and Fulcher, R0 with another power than R1. Amplitude: the
// steepness [K] of the Arrhenius law with the same slope at 25 degrees C.
#pragma once

#include <cmath>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline Experiment experiment_of_temperature_resistance(plant::Random& random) {
  const bool away = chance(random, 0.25);
  double swing_k = 0;
  if (!away) {
    swing_k = sign(random);
    swing_k *= between(random, 10, 18);
  }
  return {.profiles = {Profile::drive_two_way, Profile::forklift_shift, Profile::hppc, Profile::multi_rate},
          .swing_k = swing_k,
          .away_from_25 = away};
}

inline DrawnEffect draw_temperature_resistance(const EffectDraw& draw) {
  TemperatureLaw law = {.steepness_k = 0,
                        .zero_k = chance(draw.random, 0.5) ? 0 : between(draw.random, 140, 180),
                        .share_of_r0 = between(draw.random, 0.5, 1)};
  const double like_arrhenius = std::pow((298.15 - law.zero_k) / 298.15, 2);
  return {400, 8'000, [=](double steepness_k, World& w) {
            w.cell.temperature_law = law;
            w.cell.temperature_law.steepness_k = steepness_k * like_arrhenius;
          }};
}

inline constexpr EffectKind temperature_resistance = {
    .id = "temperature_resistance",
    .acts_on = ActsOn::cell,
    .experiment = experiment_of_temperature_resistance,
    .draw = draw_temperature_resistance,
    .needs_temperature = true,
};

}  // namespace bms::benchmark::truth::effects
