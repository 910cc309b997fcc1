// R1 has grown; C1 falls with a power of 0 to 0.8 of that growth. Amplitude: relative growth of R1.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_polarisation_growth(const EffectDraw& draw) {
  const double c1_exponent = between(draw.random, 0, 0.8);
  return {0.03, 1.2, [=](double growth, World& w) {
            w.cell.growth.of_r1 = growth;
            w.cell.growth.c1_exponent = c1_exponent;
          }};
}

inline constexpr EffectKind polarisation_growth = {
    .id = "polarisation_growth",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::hppc, Profile::multi_rate, Profile::drive_two_way, Profile::forklift_shift}};
        },
    .draw = draw_polarisation_growth,
};

}  // namespace bms::benchmark::truth::effects
