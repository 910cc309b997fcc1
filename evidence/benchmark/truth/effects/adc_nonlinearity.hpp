// Outside the catalogue: integral non-linearity of the voltage converter, a sine over the voltage. Amplitude: its
// height [V].
#pragma once

#include <numbers>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_adc_nonlinearity(const EffectDraw& draw) {
  const double period_v = between(draw.random, 0.02, 0.08), phase = between(draw.random, 0, 2 * std::numbers::pi);
  return {0.0015, 0.012, [=](double height_v, World& w) {
            w.faults.voltage.inl_v = height_v;
            w.faults.voltage.inl_period_v = period_v;
            w.faults.voltage.inl_phase = phase;
          }};
}

inline constexpr EffectKind adc_nonlinearity = {
    .id = "adc_nonlinearity",
    .acts_on = ActsOn::voltage,
    .experiment = [](plant::Random&) { return any_profile(); },
    .draw = draw_adc_nonlinearity,
    // A function of the reading itself. The same sine over the OCV is right without a load alone.
    .laws = {"voltage"},
};

}  // namespace bms::benchmark::truth::effects
