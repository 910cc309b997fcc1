// The temperature sensor has an offset, or lags behind. Amplitude: the offset [K], or the lag [s]. It shows only in a
// cell whose resistances depend on the temperature.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline Experiment experiment_of_temperature_sensor(plant::Random& random) {
  double swing_k = sign(random);
  swing_k *= between(random, 10, 18);
  return {.profiles = {Profile::drive_two_way, Profile::forklift_shift, Profile::hppc, Profile::multi_rate},
          .swing_k = swing_k};
}

inline DrawnEffect draw_temperature_sensor(const EffectDraw& draw) {
  const double direction = draw.direction;
  if (chance(draw.random, 0.4))
    return {4, 12, [=](double offset_k, World& w) { w.faults.temperature.offset_k = direction * offset_k; }};
  return {300, 1'500, [](double lag_s, World& w) { w.faults.temperature.lag_s = lag_s; }};
}

inline constexpr EffectKind temperature_sensor = {
    .id = "temperature_sensor",
    .acts_on = ActsOn::temperature,
    .experiment = experiment_of_temperature_sensor,
    .draw = draw_temperature_sensor,
    .needs_temperature = true,
    .needs_other_effect = true,
};

}  // namespace bms::benchmark::truth::effects
