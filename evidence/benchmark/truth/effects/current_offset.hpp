// Offset of the current sensor that varies by 5 to 20 % of itself over 0.5 to 2 h. Amplitude: its mean [A].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_current_offset(const EffectDraw& draw) {
  const double unsteady = between(draw.random, 0.05, 0.2), correlation_s = log_between(draw.random, 1'800, 7'200);
  const double direction = draw.direction;
  const std::uint64_t seed = draw.seed;
  return {0.0005 * draw.one_c_a, 0.02 * draw.one_c_a, [=](double mean_a, World& w) {
            w.faults.current.offset_scale = mean_a;
            w.faults.current.offset_a = ornstein_uhlenbeck(
                EffectDraw::series_seed(seed, w), w.stimulus.current_a.size(), w.stimulus.step_s, correlation_s);
            for (double& v : w.faults.current.offset_a) v = direction * (1 + unsteady * v);
          }};
}

inline constexpr EffectKind current_offset = {
    .id = "current_offset",
    .acts_on = ActsOn::current,
    .experiment =
        [](plant::Random&) {
          return Experiment{
              .profiles = {Profile::full_cycle, Profile::storage, Profile::minor_loops, Profile::many_cycles}};
        },
    .draw = draw_current_offset,
};

}  // namespace bms::benchmark::truth::effects
