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

template <class S, Estimate<S> (*step)(SocEstimator<S>&, const Sample&)>
class Application {
 public:
  Application(const std::optional<StartingPoint>& start, const messages::Identity& identity)
      : estimator_{start ? SocEstimator<S>(*start) : SocEstimator<S>()}, telemetry_{identity} {}

  void take(const Sample& sample) {
    const Estimate<S> estimate = step(estimator_, sample);
    hal::record(words(estimate));
    telemetry_.tell(sample, estimate);
    hal::watchdog_feed();
  }

 private:
  SocEstimator<S> estimator_;
  Telemetry<S> telemetry_;
};

}  // namespace bms
