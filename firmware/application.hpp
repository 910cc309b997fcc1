// What the firmware does with each sample: estimate, record, look at the whole, tell, feed the watchdog.
//
//   step    the estimator with its cell, as one function (firmware/estimator_step.hpp; a test brings its own)
//   look    what is known beside the estimate (estimator/condition.hpp), the same
//
// Sees the estimator and the hal, never a register; runs on a host that supplies the few functions of hal/ it calls.
#pragma once

#include <optional>

#include "estimator/soc_estimator.hpp"
#include "firmware/commands.hpp"
#include "firmware/telemetry.hpp"
#include "hal/record.hpp"
#include "hal/requests.hpp"
#include "hal/watchdog.hpp"

namespace bms {

template <class Estimator, typename Estimator::Result (*step)(Estimator&, const Sample&),
          void (*look)(Condition<Estimator>&, const Estimator&, const Sample&, const typename Estimator::Result&, bool limits_wanted)>
class Application {
 public:
  Application(const std::optional<StartingPoint>& start, const messages::Identity& identity, float capacity_ah)
      : estimator_{start ? Estimator(*start) : Estimator()}, telemetry_{identity, capacity_ah, start} {}

  void take(const Sample& sample) {
    const auto estimate = step(estimator_, sample);
    hal::record(words(estimate));
    look(condition_, estimator_, sample, estimate, hal::can_listening());
    telemetry_.tell(sample, estimate, condition_, requested_.log_samples);
    hear(sample.time_us);
    hal::watchdog_feed();
  }

 private:
  static constexpr int most_requests = 4;  // a sample must not take longer because somebody asks much

  void hear(std::uint64_t now_us) {
    hal::CanFrame frame;
    for (int k = 0; k < most_requests && hal::next_request(frame); ++k) {
      if (const auto answer = commands_.take(frame, now_us, requested_)) telemetry_.answer(*answer);
    }
  }

  Estimator estimator_;
  Condition<Estimator> condition_;
  Telemetry<Estimator> telemetry_;
  Commands commands_;
  Requested requested_;
};

}  // namespace bms
