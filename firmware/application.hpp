// What the firmware does with each sample: estimate, record, look at the whole, tell, feed the watchdog.
//
//   step    the estimator with its cell, as one function (firmware/estimator_step.hpp; a test brings its own)
//   look    what is known beside the estimate (estimator/condition.hpp), the same
//
// Sees the estimator and the hal, never a register; runs on a host that supplies the few functions of hal/ it calls.
#pragma once

#include <optional>

#include "estimator/soc_estimator.hpp"
#include "firmware/telemetry.hpp"
#include "hal/record.hpp"
#include "hal/watchdog.hpp"

namespace bms {

template <class Estimator, typename Estimator::Result (*step)(Estimator&, const Sample&),
          void (*look)(Condition<Estimator>&, const Estimator&, const Sample&, const typename Estimator::Result&, bool limits_wanted)>
class Application {
 public:
  Application(const std::optional<StartingPoint>& start, const messages::Identity& identity, float capacity_ah)
      : estimator_{start ? Estimator(*start) : Estimator()}, telemetry_{identity, capacity_ah} {}

  void take(const Sample& sample) {
    const auto estimate = step(estimator_, sample);
    hal::record(words(estimate));
    look(condition_, estimator_, sample, estimate, hal::can_listening());
    telemetry_.tell(sample, estimate, condition_);
    hal::watchdog_feed();
  }

 private:
  Estimator estimator_;
  Condition<Estimator> condition_;
  Telemetry<Estimator> telemetry_;
};

}  // namespace bms
