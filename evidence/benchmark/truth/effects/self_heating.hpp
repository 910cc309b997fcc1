// Two thermal nodes: the resistances follow the core, the sensor sits on a well cooled can. Amplitude: thermal
// resistance between core and can [K/W].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_self_heating(const EffectDraw& draw) {
  const TemperatureLaw law = {
      .steepness_k = between(draw.random, 2'500, 5'500), .zero_k = 0, .share_of_r0 = between(draw.random, 0.6, 1)};
  const double share = between(draw.random, 0.75, 0.9), cooling = between(draw.random, 10, 20);
  return {0.2 / draw.capacity_ratio, 15 / draw.capacity_ratio, [=](double to_can_k_per_w, World& w) {
            w.cell.temperature_law = law;
            w.cell.core = {.to_can_k_per_w = to_can_k_per_w, .share_of_heat_capacity = share, .cooling = cooling};
          }};
}

inline constexpr EffectKind self_heating = {
    .id = "self_heating",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::multi_rate, Profile::drive_two_way, Profile::many_cycles},
                            .current_scale = 1.4};
        },
    .draw = draw_self_heating,
    .needs_temperature = true,
    .needs_steady_ambient = true,
};

}  // namespace bms::benchmark::truth::effects
