#include "hil/received_state.hpp"

#include <algorithm>
#include <cmath>

namespace bms::hil {

void ReceivedState::receive(double time_s, const can::Frame& frame) {
  if (bus_.receive(monitor::to_bus_frame(frame, std::llround(1e6 * time_s))) == monitor::messages().size()) return;
  switch (frame.id) {
    case can::PackState::id:
      pack = can::PackState::of(frame);
      pack_received = true;
      break;
    case can::ContactorState::id:
      contactors = can::ContactorState::of(frame);
      break;
    case can::AllowedCurrent::id:
      allowed = can::AllowedCurrent::of(frame);
      break;
    case can::RequestChallenge::id:
      request_challenge = can::RequestChallenge::of(frame);
      break;
    case can::Status::id:
      status_received = true;
      break;
    case can::Faults::id:
      update_faults(time_s, can::Faults::of(frame));
      break;
    case can::MoreFaults::id:
      update_faults(time_s, can::MoreFaults::of(frame));
      break;
    default:
      break;
  }
}

std::uint64_t ReceivedState::sum(std::uint64_t monitor::MessageState::*count) const {
  std::uint64_t all = 0;
  for (const monitor::MessageState& state : bus_.states()) all += state.*count;
  return all;
}

template <class Message>
void ReceivedState::update_faults(double time_s, Message message) {
  message.each([&](const char* name, const char*, auto& value, const can::SignalLayout& layout) {
    if (layout.bits != 1) return;
    const auto last = std::find_if(faults.rbegin(), faults.rend(), [&](const FaultEvent& f) { return f.name == name; });
    const bool raised = last != faults.rend() && !last->cleared_at_s;
    if (value != 0 && !raised) faults.push_back({name, time_s, {}});
    if (value == 0 && raised) last->cleared_at_s = time_s;
  });
}

}  // namespace bms::hil
