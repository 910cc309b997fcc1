// A Butler-Volmer electrode with alpha of 0.35 to 0.65 in place of a share of R0 and of R1; the resistance at small
// currents does not change. Amplitude: that share.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_charge_transfer(const EffectDraw& draw) {
  const double alpha = between(draw.random, 0.35, 0.65);
  const double r0_part = chance(draw.random, 0.5) ? between(draw.random, 0, 0.5) : 0;
  const double r1_part = chance(draw.random, 0.8) || r0_part == 0 ? 1 : 0;
  return {0.02, 0.9, [=](double share, World& w) {
            w.cell.charge_transfer = {.share_of_r0 = share * r0_part, .share_of_r1 = share * r1_part, .alpha = alpha};
          }};
}

inline constexpr EffectKind charge_transfer = {
    .id = "charge_transfer",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random& random) {
          return Experiment{.profiles = {Profile::multi_rate, Profile::drive_two_way},
                            .current_scale = between(random, 1.2, 1.8)};
        },
    .draw = draw_charge_transfer,
};

}  // namespace bms::benchmark::truth::effects
