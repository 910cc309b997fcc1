// One channel is late: a delay of the current or of the voltage, and a low-pass in the late channel. Amplitude: the
// delay [s].
#pragma once

#include "benchmark/truth/effect_kind.hpp"

namespace bms::benchmark::truth::effects {

inline DrawnEffect draw_channel_skew(const EffectDraw& draw) {
  const double filtered = between(draw.random, 0, 0.5), direction = draw.direction;
  return {0.06, 3, [=](double delay_s, World& w) {
            w.faults.current.late_s = direction * delay_s;
            (direction > 0 ? w.faults.current.filter_s : w.faults.voltage.filter_s) = filtered * delay_s;
          }};
}

inline constexpr EffectKind channel_skew = {
    .id = "channel_skew",
    .acts_on = ActsOn::current,
    .experiment =
        [](plant::Random&) {
          return Experiment{.profiles = {Profile::drive_two_way, Profile::multi_rate, Profile::forklift_shift,
                                         Profile::drive_discharge}};
        },
    .draw = draw_channel_skew,
};

}  // namespace bms::benchmark::truth::effects
