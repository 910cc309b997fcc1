// Outside the catalogue: two unequal cells in parallel. Amplitude: their inequality in capacity.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_parallel_imbalance(const EffectDraw& draw) {
  const double exponent = between(draw.random, 0, 1.5);  // -1: the cells share the current in proportion to capacity
  return {0.05, 0.6, [=](double inequality, World& w) {
            w.cell.parallel = {.inequality = inequality, .resistance_exponent = exponent};
          }};
}

inline constexpr EffectKind parallel_imbalance = {
    .id = "parallel_imbalance",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::full_cycle, Profile::minor_loops, Profile::hppc}};
        },
    .draw = draw_parallel_imbalance,
    // Together both cells have the resistances and the OCV of one cell at rest. The misfit is the charge that flows
    // between them after the load, within minutes to hours.
    .laws = {"slow"},
};

}  // namespace bms::benchmark::truth::effects
