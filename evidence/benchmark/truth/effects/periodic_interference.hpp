// Outside the catalogue: interference of 0.5 to 5 mHz with its second harmonic on the voltage. Amplitude: its height
// [V].
#pragma once

#include <cmath>
#include <numbers>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_periodic_interference(const EffectDraw& draw) {
  const double frequency_hz = log_between(draw.random, 0.0005, 0.005);
  const double phase = between(draw.random, 0, 2 * std::numbers::pi), second = between(draw.random, 0, 0.4);
  return {0.0005, 0.012, [=](double height_v, World& w) {
            w.faults.voltage.hum_v = height_v;
            w.faults.voltage.hum.resize(w.stimulus.current_a.size());
            for (std::size_t k = 0; k < w.faults.voltage.hum.size(); ++k) {
              const double turn =
                  2 * std::numbers::pi * frequency_hz * static_cast<double>(k) * w.stimulus.step_s + phase;
              w.faults.voltage.hum[k] = std::sin(turn) + second * std::sin(2 * turn + 1);
            }
          }};
}

inline constexpr EffectKind periodic_interference = {
    .id = "periodic_interference",
    .acts_on = ActsOn::voltage,
    .experiment = [](plant::Random&) { return any_profile(); },
    .draw = draw_periodic_interference,
    // It comes with the voltage channel, whatever the cell does.
    .laws = {"voltage"},
};

}  // namespace bms::benchmark::truth::effects
