// Outside the catalogue: the voltage reading moves only when the voltage has left it by a threshold. Amplitude: the
// threshold [V].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_sticky_converter(const EffectDraw&) {
  return {0.003, 0.03, [](double threshold_v, World& w) { w.faults.voltage.sticks_v = threshold_v; }};
}

inline constexpr EffectKind sticky_converter = {
    .id = "sticky_converter",
    .acts_on = ActsOn::voltage,
    .experiment = [](plant::Random&) { return any_profile(); },
    .draw = draw_sticky_converter,
    // The voltage channel shows an old reading until the voltage has moved on: an error of that reading, or that it is
    // late, are the same.
    .laws = {"voltage", "timing"},
};

}  // namespace bms::benchmark::truth::effects
