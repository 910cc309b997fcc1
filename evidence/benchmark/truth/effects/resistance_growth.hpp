// R0 has grown, tilted over SOC. Amplitude: relative growth at 50 % SOC.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_resistance_growth(const EffectDraw& draw) {
  const double tilt = between(draw.random, -0.3, 0.3);
  return {0.01, 0.8, [=](double growth, World& w) {
            w.cell.growth.of_r0 = growth;
            w.cell.growth.r0_tilt = tilt;
          }};
}

inline constexpr EffectKind resistance_growth = {
    .id = "resistance_growth",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::hppc, Profile::multi_rate, Profile::drive_two_way, Profile::forklift_shift}};
        },
    .draw = draw_resistance_growth,
};

}  // namespace bms::benchmark::truth::effects
