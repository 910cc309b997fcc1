// The last messages that the board published, and the history of its faults.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "can_messages.hpp"  // generated from firmware/can/greybox_bms.dbc
#include "monitor/bus_state.hpp"

namespace bms::hil {

/// One interval in which the board published a fault (a bit of the messages Faults and MoreFaults).
struct FaultEvent {
  std::string name;  ///< as in the DBC file
  double raised_at_s = 0;
  std::optional<double> cleared_at_s;  ///< empty: still active at the end
};

class ReceivedState {
 public:
  can::PackState pack;
  can::ContactorState contactors;
  can::AllowedCurrent allowed;
  can::RequestChallenge request_challenge;
  bool pack_received = false, status_received = false;  ///< since the caller last reset them
  std::vector<FaultEvent> faults;

  /// Ignores frames with a wrong length, CRC or counter.
  void receive(double time_s, const can::Frame& frame);
  std::uint64_t lost() const { return sum(&monitor::MessageState::lost); }
  std::uint64_t crc_errors() const { return sum(&monitor::MessageState::crc_errors); }

 private:
  std::uint64_t sum(std::uint64_t monitor::MessageState::*count) const;
  /// Message: Faults or MoreFaults.
  template <class Message>
  void update_faults(double time_s, Message message);

  monitor::BusState bus_;
};

}  // namespace bms::hil
