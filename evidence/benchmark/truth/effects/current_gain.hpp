// Gain error of the current sensor. Amplitude: relative error.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_current_gain(const EffectDraw& draw) {
  const double direction = draw.direction;
  return {0.005, 0.1, [=](double error, World& w) { w.faults.current.gain = direction * error; }};
}

inline constexpr EffectKind current_gain = {
    .id = "current_gain",
    .acts_on = ActsOn::current,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::full_cycle, Profile::many_cycles, Profile::storage, Profile::hppc}};
        },
    .draw = draw_current_gain,
};

}  // namespace bms::benchmark::truth::effects
