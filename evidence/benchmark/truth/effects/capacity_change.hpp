// Less capacity than the cell file states. Amplitude: the missing fraction.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_capacity_change(const EffectDraw&) {
  return {0.008, 0.25, [](double missing, World& w) { w.cell.capacity_factor = 1 - missing; }};
}

inline constexpr EffectKind capacity_change = {
    .id = "capacity_change",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::full_cycle, Profile::many_cycles, Profile::storage, Profile::hppc}};
        },
    .draw = draw_capacity_change,
};

}  // namespace bms::benchmark::truth::effects
