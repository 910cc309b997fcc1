// A self-discharge current that grows exponentially with the voltage. Amplitude: the current at 3.3 V [A].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_leakage(const EffectDraw& draw) {
  const double per_e_v = between(draw.random, 0.08, 0.3);
  return {0.0002 * draw.one_c_a, 0.015 * draw.one_c_a,
          [=](double at_3v3_a, World& w) { w.cell.leak = {.at_3v3_a = at_3v3_a, .per_e_v = per_e_v}; }};
}

inline constexpr EffectKind leakage = {
    .id = "leakage",
    .acts_on = ActsOn::cell,
    .experiment = [](plant::Random&) { return Experiment{.profiles = {Profile::storage}}; },
    .draw = draw_leakage,
};

}  // namespace bms::benchmark::truth::effects
