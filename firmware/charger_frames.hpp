// Which frames the profile of a charger receives: those of its own bus, or of the truck's bus if it has none. What a
// node of the truck sends is then nothing for the charge, and what a charger sends is nothing for the application.
#pragma once

#include <cstdint>

#include "hal/charger_bus.hpp"
#include "hal/requests.hpp"

namespace bms::firmware {

/// frame: of the truck's bus, and not for the application.
template <class Profile>
[[gnu::always_inline]] inline void receive_from_truck_bus(Profile& profile, const can::Frame& frame,
                                                          std::uint64_t now_us) {
  if constexpr (!hal::has_charger_bus)
    profile.receive(frame, now_us);
  else if constexpr (requires { profile.receive_from_truck(frame); })
    profile.receive_from_truck(frame);
}

/// Frames of other protocols, of each bus at most so many in a sample. frame: where they are stored.
template <class Truck, class Profile>
[[gnu::always_inline]] inline void receive_network_frames(can::Frame& frame, Truck& truck, Profile& profile, int most,
                                                          std::uint64_t now_us) {
  for (int k = 0; k < most && hal::next_network_frame(frame); ++k) {
    if (!truck.receive(frame, now_us)) receive_from_truck_bus(profile, frame, now_us);
  }
  if constexpr (hal::has_charger_bus) {
    for (int k = 0; k < most && hal::charger_can_receive(frame); ++k) profile.receive(frame, now_us);
  }
}

}  // namespace bms::firmware
