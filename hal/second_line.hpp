// The second line of protection: what the own protections of the measuring chip have opened, independently of this
// core. Back ends: bq76952/samples, absent/second_line (no such chip).
#pragma once

#include <cstdint>

namespace bms::hal {

/// One bit each.
enum SecondLineTrip : std::uint32_t {
  cell_undervoltage = 1,
  cell_overvoltage = 2,
  charge_overcurrent = 4,
  discharge_overcurrent = 8,
  short_circuit = 16,
  temperature = 32,
  host_silence = 64,  ///< the chip had no host or no settings for a time: it was silent to it, was reset or configured
  permanent_failure = 128,
  pins_wrong = 256,  ///< the enable outputs do not follow the protections
};

/// Trips of the last sample and of all samples since the last call of next_sample(), bits of SecondLineTrip; 0: none. A
/// trip that came and went between two samples is included. A latched short circuit is included when it is first seen.
std::uint32_t second_line_trips();

/// Ends a short circuit that the chip has latched. Call it when protection has ended its fault, with open contactors.
void second_line_clear();

enum class FrontEndState : std::uint8_t { absent, configuring, measuring };

/// State of the measuring chip and counters since boot; they wrap.
struct FrontEndHealth {
  FrontEndState state = FrontEndState::absent;
  std::uint32_t lost = 0;    ///< times that measuring ended
  std::uint32_t resets = 0;  ///< resets of the chip while measuring
  std::uint32_t bad_crc = 0;
};
FrontEndHealth front_end_health();

}  // namespace bms::hal
