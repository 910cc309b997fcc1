// A contact resistance that appears within 1 to 5 s and stays. Amplitude: the resistance [ohm].
#pragma once

#include <algorithm>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_contact_step(const EffectDraw& draw) {
  const double at = between(draw.random, 0.2, 0.75), ramp_s = between(draw.random, 1, 5);
  return {0.02 * draw.r0_ohm, 1.5 * draw.r0_ohm, [=](double resistance_ohm, World& w) {
            w.cell.contact_scale = resistance_ohm;
            w.cell.contact_ohm.assign(w.stimulus.current_a.size(), 1.0);
            if (w.holdout) return;  // the step was before
            for (std::size_t k = 0; k < w.cell.contact_ohm.size(); ++k) {
              const double since_s =
                  (static_cast<double>(k) - at * static_cast<double>(w.cell.contact_ohm.size())) * w.stimulus.step_s;
              w.cell.contact_ohm[k] = std::clamp(since_s / ramp_s, 0.0, 1.0);
            }
          }};
}

inline constexpr EffectKind contact_step = {
    .id = "contact_step",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::drive_two_way, Profile::forklift_shift, Profile::drive_discharge, Profile::hppc}};
        },
    .draw = draw_contact_step,
};

}  // namespace bms::benchmark::truth::effects
