// Which message goes out when. Time is the samples' own: a recording fed in faster than it was made gives the same frames.
//
// Nothing is sent while nobody listens. Every sample that is told ends with the status frame, so that who has
// read it has the whole sample and may send the next (lock step).
#pragma once

#include <array>
#include <cstdint>

#include "firmware/messages.hpp"
#include "hal/can.hpp"
#include "hal/power.hpp"

namespace bms {

template <class Estimator>
class Telemetry {
 public:
  using Result = typename Estimator::Result;

  /// capacity_ah: of the cell file.
  constexpr Telemetry(const messages::Identity& identity, float capacity_ah) : identity_(identity), capacity_ah_(capacity_ah) {}

  void tell(const Sample& sample, const Result& estimate, const Condition<Estimator>& condition) {
    ++samples_;
    if (!hal::can_listening()) return;
    tell_fault();
    now_us_ = sample.time_us;
    by_time(0, [&] { return messages::identity(identity_); });
    by_time(1, [&] { return messages::current_limits(condition); });
    by_time(2, [&] { return messages::health(condition); });
    by_time(3, [&] { return messages::soc_anchor(condition); });
    if constexpr (Estimator::Model::errors_are_states) by_time(4, [&] { return messages::sensor_errors(estimate, capacity_ah_); });
    send(5, messages::pack_state(estimate, condition));
    send(6, messages::pack_electrical(sample));
    send(7, messages::model_detail(estimate));
    can::Status status;
    status.flags = estimate.flags;
    status.sample_counter = samples_;
    status.reset_cause = static_cast<std::uint32_t>(hal::reset_cause());
    send(8, status);
  }

 private:
  static constexpr std::size_t by_time_count = 5, messages_count = 11;

  template <class Message>
  void send(std::size_t place, const Message& message) {
    hal::can_send(message.frame(counter_[place]));
    counter_[place] = can::next(counter_[place]);
  }

  /// message(): made when it is due. Unsigned: a time that went back is due as well.
  template <class Make>
  void by_time(std::size_t place, Make&& message) {
    using Message = decltype(message());
    if (sent_[place].once && now_us_ - sent_[place].at_us < Message::cycle_us) return;
    sent_[place] = {now_us_, true};
    send(place, message());
  }

  void tell_fault() {
    if (fault_told_) return;
    fault_told_ = true;
    const auto fault = hal::last_fault();
    if (!fault) return;
    can::LastFaultAddress address;
    address.program_counter = fault->pc;
    send(9, address);
    can::LastFaultCause cause;
    cause.configurable_fault_status = fault->cfsr;
    send(10, cause);
  }

  struct Sent {
    std::uint64_t at_us = 0;
    bool once = false;
  };
  messages::Identity identity_;
  float capacity_ah_ = 0;
  std::array<Sent, by_time_count> sent_{};
  std::array<std::uint8_t, messages_count> counter_{};
  std::uint64_t now_us_ = 0;
  std::uint16_t samples_ = 0;
  bool fault_told_ = false;
};

}  // namespace bms
