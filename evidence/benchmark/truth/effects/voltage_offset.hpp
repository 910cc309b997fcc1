// Offset of the voltage sensor that varies by 2 to 8 % of itself over 1.5 h. Amplitude: its mean [V].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_voltage_offset(const EffectDraw& draw) {
  const double unsteady = between(draw.random, 0.02, 0.08), direction = draw.direction;
  const std::uint64_t seed = draw.seed;
  return {0.001, 0.025, [=](double mean_v, World& w) {
            constexpr double correlation_s = 5'400;
            w.faults.voltage.offset_scale = mean_v;
            w.faults.voltage.offset_v = ornstein_uhlenbeck(
                EffectDraw::series_seed(seed, w), w.stimulus.current_a.size(), w.stimulus.step_s, correlation_s);
            for (double& v : w.faults.voltage.offset_v) v = direction * (1 + unsteady * v);
          }};
}

inline constexpr EffectKind voltage_offset = {
    .id = "voltage_offset",
    .acts_on = ActsOn::voltage,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::hppc, Profile::minor_loops, Profile::full_cycle, Profile::storage}};
        },
    .draw = draw_voltage_offset,
};

}  // namespace bms::benchmark::truth::effects
