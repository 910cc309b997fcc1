// Gain error of the voltage sensor. Amplitude: relative error.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_voltage_gain(const EffectDraw& draw) {
  const double direction = draw.direction;
  return {0.0003, 0.008, [=](double error, World& w) { w.faults.voltage.gain = direction * error; }};
}

inline constexpr EffectKind voltage_gain = {
    .id = "voltage_gain",
    .acts_on = ActsOn::voltage,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::hppc, Profile::minor_loops, Profile::full_cycle, Profile::storage}};
        },
    .draw = draw_voltage_gain,
};

}  // namespace bms::benchmark::truth::effects
