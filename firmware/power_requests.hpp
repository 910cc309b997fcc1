// The one place that decides which request for power the contactors follow.
//
//   source    asks by                                                     asks for nothing by
//   truck     Command request 1 or 2, DriveRequest (firmware/access.hpp)  request 0, or silence of five seconds
//   charger   its state: Cia418Profile::charger(), the plug               any other state, or no heartbeat
//   key       its input, if the build closes by inputs                    off
//
//   1. A stop (frame Stop) ends the request of every source until that source asks again: it has to ask for nothing
//      first. A source that only goes on is not followed, nor is anything that arrives with the same sample.
//      Of a request 0 and a request for power with the same sample the order is not known (hal/request_queue.hpp):
//      request 0 wins, and the truck, which repeats its request, is followed with the next one.
//   2. A truck does not drive while a charger is present (EN 1175): then neither is followed.
//   3. The truck's request or that of its key, then the charger's.
//
// Request 0 ends the request of the truck and of no other source, because a parked truck repeats it every second.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "protection/contactors.hpp"

namespace bms::firmware {

/// A charger, as its profile knows it.
struct ChargerState {
  bool present = false;  ///< a truck must not drive
  bool asks = false;     ///< for a charge
};

class PowerRequests {
 public:
  using Request = protection::Request;
  static constexpr std::uint64_t timeout_us = 5'000'000;

  constexpr void stop(std::uint64_t now_us) {
    stopped_.fill(true);
    stopped_us_ = now_us;
    any_stop_ = true;
  }
  /// The truck asks for nothing.
  constexpr void withdraw(std::uint64_t now_us) {
    truck_ = Request::none;
    stopped_[truck] = false;
    withdrawn_us_ = now_us;
    any_withdrawn_ = true;
  }
  /// The truck asks and may. Returns false if a stop stands against it.
  constexpr bool ask(Request wanted, std::uint64_t now_us) {
    const bool stopped_now = any_stop_ && stopped_us_ == now_us;
    if (any_withdrawn_ && withdrawn_us_ == now_us && !stopped_now) return false;
    if (truck_request(now_us) == Request::none) stopped_[truck] = stopped_now;
    truck_ = wanted;
    asked_us_ = now_us;
    return !stopped_[truck];
  }

  /// The request to follow. Call with every sample.
  constexpr Request active(const ChargerState& now, std::uint64_t now_us, bool key_on = false) {
    if (!now.asks) stopped_[charger] = false;
    if (!key_on) stopped_[key] = false;
    Request of_truck = stopped_[truck] ? Request::none : truck_request(now_us);
    if (of_truck == Request::none && key_on && !stopped_[key]) of_truck = Request::drive;
    if (of_truck == Request::drive && now.present) return Request::none;
    return of_truck == Request::none && now.asks && !stopped_[charger] ? Request::charge : of_truck;
  }

  constexpr bool operator==(const PowerRequests&) const = default;

 private:
  enum Source : std::size_t { truck, charger, key, sources };

  /// What the truck asks for, followed or not.
  constexpr Request truck_request(std::uint64_t now_us) const {
    return now_us - asked_us_ < timeout_us ? truck_ : Request::none;
  }
  std::array<bool, sources> stopped_{};  ///< by a stop, since when the source has not asked for nothing
  Request truck_ = Request::none;
  std::uint64_t asked_us_ = 0, stopped_us_ = 0, withdrawn_us_ = 0;  ///< of the newest of each kind
  bool any_stop_ = false, any_withdrawn_ = false;
};

}  // namespace bms::firmware
