// The place of a profile of other makers' devices (firmware/j1939_profile.hpp, firmware/cia418_profile.hpp,
// firmware/elcon_profile.hpp) in an image that has none.
#pragma once

#include <cstddef>
#include <cstdint>

#include "can/frame.hpp"
#include "firmware/power_requests.hpp"
#include "firmware/snapshot.hpp"

namespace bms::firmware {

/// Only the battery's own messages.
struct WithoutVehicleProfile {
  template <class Estimator, std::size_t Cells>
  constexpr void publish(const Snapshot<Estimator, Cells>&) {}
  constexpr void receive(const can::Frame&, std::uint64_t) {}
  constexpr ChargerState charger(std::uint64_t) const { return {}; }
};

}  // namespace bms::firmware
