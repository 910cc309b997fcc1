// Synthetic CAN traffic of a BMS in a truck that drives and charges, sample by sample, in the order in which the
// firmware sends.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "can_messages.hpp"
#include "monitor/bus_frame.hpp"

namespace bms::monitor {

class Traffic {
 public:
  explicit Traffic(std::int64_t begin_us = 1'700'000'000'000'000, std::int64_t step_us = 1'000'000)
      : begin_us_(begin_us), step_us_(step_us) {}

  /// The frames of the next sample. Messages that are sent once per second come first, the status message last.
  std::vector<BusFrame> sample() {
    frames_.clear();
    const auto k = static_cast<float>(samples_);
    now_us_ = begin_us_ + static_cast<std::int64_t>(samples_++) * step_us_;
    if (samples_ == 1 || now_us_ - second_us_ >= 1'000'000) {
      second_us_ = now_us_;
      can::Identity identity;
      identity.cell_hash = 0xCAFE1234;
      identity.version_minor = 1;
      send(identity, 0);
      can::CurrentLimits limits;
      limits.discharge_now = 60;
      limits.charge_now = 30;
      limits.discharge_ten_seconds = 48;
      limits.charge_ten_seconds = 24;
      send(limits, 1);
      can::Health health;
      health.capacity = 97.5F;
      health.capacity_sigma = 1.2F;
      health.resistance = 112;
      health.resistance_sigma = 4;
      send(health, 2);
      can::SocAnchor anchor;
      anchor.observable = 1;
      anchor.seconds_since_anchor = 90;
      anchor.charge_since_anchor = 3.5F;
      send(anchor, 3);
    }
    can::PackState state;
    state.soc_quality = can::PackState::soc_quality_carried_by_counting;
    state.soc = soc_percent(k);
    state.soc_sigma = 0.8F + 0.3F * std::sin(k / 300);
    state.soc_display = soc_percent(k);
    send(state, 4);
    can::PackElectrical electrical;
    electrical.current = 12 * std::sin(k / 7) - 4;
    electrical.voltage = 3.3F + 0.004F * (12 * std::sin(k / 7) - 4);
    electrical.temperature = 24 + 6 * std::sin(k / 2000);
    send(electrical, 5);
    can::ModelDetail detail;
    detail.voltage_rc = -0.01F;
    detail.voltage_predicted = 3.29F;
    send(detail, 6);
    can::Status status;
    status.flags = flags;
    status.reset_cause = can::Status::reset_cause_power_on;
    status.sample_counter = static_cast<std::uint32_t>(samples_) & 0xFFFF;
    send(status, 7);
    return frames_;
  }

  static float soc_percent(float k) { return 50 + 30 * std::cos(k / 2700); }
  std::int64_t now_us() const { return now_us_; }

  std::uint32_t flags = 0;

 private:
  template <class Message>
  void send(const Message& message, std::size_t place) {
    frames_.push_back(to_bus_frame(message.frame(counters_[place]), now_us_));
    counters_[place] = can::next(counters_[place]);
  }

  std::int64_t begin_us_, step_us_, now_us_ = 0, second_us_ = 0;
  std::uint64_t samples_ = 0;
  std::uint8_t counters_[8] = {};
  std::vector<BusFrame> frames_;
};

}  // namespace bms::monitor
