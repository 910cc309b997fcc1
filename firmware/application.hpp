// What the firmware does with each sample: estimate, record, tell, feed the watchdog.
// Sees the estimator and the hal, never a register; the cell comes in through estimator_step().
#pragma once

#include <cstdint>

#include "estimator/soc_estimator.hpp"
#include "firmware/estimator_step.hpp"
#include "firmware/messages.hpp"
#include "hal/can.hpp"
#include "hal/power.hpp"
#include "hal/record.hpp"
#include "hal/watchdog.hpp"

namespace bms {

class Application {
 public:
  explicit Application(const std::optional<StartingPoint>& start) : estimator_{start ? Estimator(*start) : Estimator()} {}

  void take(const Sample& sample) {
    const Estimate<BoardScalar> estimate = estimator_step(estimator_, sample);
    hal::record(words(estimate));
    if (hal::can_listening()) tell(sample, estimate);
    hal::watchdog_feed();
  }

 private:
  using Estimator = SocEstimator<BoardScalar>;
  static constexpr std::uint64_t identity_cycle_us = 1'000'000;

  void tell(const Sample& sample, const Estimate<BoardScalar>& estimate) {
    if (const auto fault = hal::last_fault(); fault && !told_fault_) hal::can_send(messages::frame_of_two(messages::fault_id, fault->pc, fault->cfsr));
    told_fault_ = true;
    if (identity_at_us_ == 0 || sample.time_us >= identity_at_us_) {
      hal::can_send(messages::frame_of_two(messages::identity_id, cell_hash(), firmware_version));
      identity_at_us_ = sample.time_us + identity_cycle_us;
    }
    hal::can_send(messages::frame_of(messages::pack_state(sample, estimate)));
    hal::can_send(messages::estimate_frame(estimate));
    hal::can_send(messages::frame_of(messages::Status{estimate.flags, ++samples_, ++frames_, static_cast<std::uint8_t>(hal::reset_cause())}));
  }

  Estimator estimator_;
  std::uint64_t identity_at_us_ = 0;
  std::uint16_t samples_ = 0;
  std::uint8_t frames_ = 0;
  bool told_fault_ = false;
};

}  // namespace bms
