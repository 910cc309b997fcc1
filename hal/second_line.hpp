// The second line of protection: what the own protections of the measuring chip have opened, independently of this
// core. Back ends: bq76952/samples, absent/second_line (no such chip).
#pragma once

#include <cstdint>

#include "measurement/second_line.hpp"

namespace bms::hal {

using measurement::SecondLineTrip;
using enum measurement::SecondLineTrip;

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
