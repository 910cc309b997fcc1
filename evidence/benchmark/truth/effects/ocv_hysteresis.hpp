// OCV hysteresis: 10 to 30 play operators in charge, with widths of 0.2 to 20 % of the capacity. The gap is tilted over
// SOC. A third of the cells was calibrated on the discharge branch. Amplitude: half of the gap [V].
#pragma once

#include <cmath>

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_ocv_hysteresis(const EffectDraw& draw) {
  Hysteresis h;
  h.tilt = between(draw.random, -0.4, 0.4);
  h.on_discharge_branch = chance(draw.random, 1.0 / 3);
  const std::size_t plays = 10 + below(draw.random, 21);
  const double centre = log_between(draw.random, 0.006, 0.06), spread = between(draw.random, 0.8, 1.3);
  double sum = 0;
  for (std::size_t k = 0; k < plays; ++k) {
    const double width = 0.002 * std::pow(100.0, static_cast<double>(k) / static_cast<double>(plays - 1));
    const double off = std::log(width / centre) / spread;
    h.half_width.push_back(width / 2);
    h.share.push_back(std::exp(-off * off / 2) * between(draw.random, 0.6, 1.4));
    sum += h.share.back();
  }
  for (double& share : h.share) share /= sum;
  return {0.001, 0.025, [h](double half_gap_v, World& w) {
            w.cell.hysteresis = h;
            w.cell.hysteresis.half_gap_v = half_gap_v;
          }};
}

inline constexpr EffectKind ocv_hysteresis = {
    .id = "ocv_hysteresis",
    .acts_on = ActsOn::cell,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::minor_loops, Profile::full_cycle, Profile::hppc}};
        },
    .draw = draw_ocv_hysteresis,
};

}  // namespace bms::benchmark::truth::effects
