// Trips of the second line of protection: of the measuring chip's own protections, which open by hardware.
#pragma once

#include <cstdint>

namespace bms::measurement {

/// One bit each.
enum SecondLineTrip : std::uint32_t {
  cell_undervoltage = 1,
  cell_overvoltage = 2,
  charge_overcurrent = 4,
  discharge_overcurrent = 8,
  short_circuit = 16,
  temperature = 32,   ///< a state: it lasts as long as the pack is hot or cold, and ends by itself
  host_silence = 64,  ///< the chip had no host or no settings for a time: it was silent to it, was reset or configured
  permanent_failure = 128,
  pins_wrong = 256,  ///< the enable outputs do not follow the protections
};

}  // namespace bms::measurement
