// A share of the charging current that is not stored; it grows with the current. Amplitude: that share.
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_coulombic_loss(const EffectDraw& draw) {
  const double half_a = between(draw.random, 0.2, 1) * draw.one_c_a;
  return {0.0005, 0.03, [=](double share, World& w) { w.cell.charge_loss = {.share = share, .half_a = half_a}; }};
}

inline constexpr EffectKind coulombic_loss = {
    .id = "coulombic_loss",
    .acts_on = ActsOn::cell,
    .experiment = [](plant::Random&) { return Experiment{.profiles = {Profile::many_cycles}}; },
    .draw = draw_coulombic_loss,
};

}  // namespace bms::benchmark::truth::effects
