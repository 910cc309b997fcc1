// What the firmware does with each sample: estimate, record, tell, feed the watchdog.
//
//   step    the estimator with its cell, as one function (firmware/estimator_step.hpp; a test brings its own)
//
// Sees the estimator and the hal, never a register; runs on a host that supplies the few functions of hal/ it calls.
#pragma once

#include <optional>

#include "estimator/soc_estimator.hpp"
#include "firmware/telemetry.hpp"
#include "hal/record.hpp"
#include "hal/watchdog.hpp"

namespace bms {

template <class Estimator, typename Estimator::Result (*step)(Estimator&, const Sample&)>
class Application {
 public:
  Application(const std::optional<StartingPoint>& start, const messages::Identity& identity)
      : estimator_{start ? Estimator(*start) : Estimator()}, telemetry_{identity} {}

  void take(const Sample& sample) {
    const auto estimate = step(estimator_, sample);
    hal::record(words(estimate));
    telemetry_.tell(sample, estimate);
    hal::watchdog_feed();
  }

 private:
  Estimator estimator_;
  Telemetry<typename Estimator::Scalar> telemetry_;
};

}  // namespace bms
