// Which message goes out when. Time is the samples' own: a recording fed in faster than it was made gives the same frames.
//
// Nothing is sent while nobody listens. Every sample that is told ends with the status frame, so that who has
// read it has the whole sample and may send the next (lock step).
#pragma once

#include <array>
#include <cstdint>

#include "estimator/estimate.hpp"
#include "estimator/sample.hpp"
#include "firmware/messages.hpp"
#include "hal/can.hpp"
#include "hal/power.hpp"

namespace bms {

template <class S>
class Telemetry {
 public:
  constexpr explicit Telemetry(const messages::Identity& identity) : identity_(identity) {}

  void tell(const Sample& sample, const Estimate<S>& estimate) {
    ++samples_;
    if (!hal::can_listening()) return;
    tell_fault();
    for (std::size_t k = 0; k < plan.size(); ++k) {
      if (plan[k].cycle_us != 0 && !due(k, sample.time_us)) continue;
      hal::can_send(frame(plan[k].id, sample, estimate));
    }
  }

 private:
  struct Cycle {
    std::uint16_t id;
    std::uint32_t cycle_us;  ///< 0: with every sample
  };
  static constexpr std::array<Cycle, 4> plan = {{
      {messages::identity_id, 1'000'000},
      {messages::pack_state_id, 0},
      {messages::estimate_id, 0},
      {messages::status_id, 0},
  }};

  hal::CanFrame frame(std::uint16_t id, const Sample& sample, const Estimate<S>& estimate) {
    switch (id) {
      case messages::identity_id: return messages::frame_of(identity_);
      case messages::pack_state_id: return messages::frame_of(messages::pack_state(sample, estimate));
      case messages::estimate_id: return messages::frame_of(messages::estimate_detail(estimate));
      default: return messages::frame_of(messages::Status{estimate.flags, samples_, ++statuses_, static_cast<std::uint8_t>(hal::reset_cause())});
    }
  }

  /// Unsigned: a time that went back is due as well.
  bool due(std::size_t k, std::uint64_t time_us) {
    if (sent_[k].once && time_us - sent_[k].at_us < plan[k].cycle_us) return false;
    sent_[k] = {time_us, true};
    return true;
  }

  void tell_fault() {
    if (fault_told_) return;
    fault_told_ = true;
    if (const auto fault = hal::last_fault()) hal::can_send(messages::frame_of(messages::LastFault{fault->pc, fault->cfsr}));
  }

  struct Sent {
    std::uint64_t at_us = 0;
    bool once = false;
  };
  messages::Identity identity_;
  std::array<Sent, plan.size()> sent_{};
  std::uint16_t samples_ = 0;
  std::uint8_t statuses_ = 0;
  bool fault_told_ = false;
};

}  // namespace bms
