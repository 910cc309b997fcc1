// The second line of protection: what the own protections of the measuring chip have opened, independently of this
// core. Back ends: bq76952/samples, absent/second_line (no such chip).
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"
#include "measurement/second_line.hpp"

namespace bms::hal {

using measurement::SecondLineTrip;
using enum measurement::SecondLineTrip;

/// Trips of the last sample and of all samples since the last call of next_sample(), bits of SecondLineTrip; 0: none. A
/// trip that came and went between two samples is included. A latched short circuit is included when it is first seen.
std::uint32_t second_line_trips();

/// Ends a short circuit that the chip has latched. Call it when protection has ended its fault, with open contactors.
void second_line_clear();

/// The first three are those of one chip, or of both halves of a pack of more than 16 cells. The others name the half
/// of such a pack that has no readings, the lower half before the upper one.
enum class FrontEndState : std::uint8_t {
  absent,
  configuring,
  measuring,
  lower_absent,
  upper_absent,
  lower_configuring,
  upper_configuring,
  swapped,          ///< the two buses are exchanged
  lower_misplaced,  ///< what answers on the bus of the lower half is not wired as the lower chip
  upper_misplaced,
  lower_clock_wrong,  ///< the chip's clock differs from that of this core
  upper_clock_wrong,
  lower_stale,  ///< the chip answers, but has not measured
  upper_stale,
};

/// State of the measuring chips and counters since boot, of both together; they wrap.
struct FrontEndHealth {
  FrontEndState state = FrontEndState::absent;
  std::uint32_t lost = 0;    ///< times that measuring ended
  std::uint32_t resets = 0;  ///< resets of the chip while measuring
  std::uint32_t bad_crc = 0;
  std::int16_t die_cdegc = measurement::no_temperature;  ///< of the warmer chip [0.01 degrees C], of the last sample
};
FrontEndHealth front_end_health();

}  // namespace bms::hal
