// Protections of the measuring chip, which open by hardware.
// Back ends: bq76952/samples, absent/second_line (no such chip).
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
  host_silence = 64,
  permanent_failure = 128,
  pins_wrong = 256
};

/// Trips of the last sample and of all samples since the last call of next_sample(): a trip that came and went between
/// two samples is included.
std::uint32_t second_line_trips();

}  // namespace bms::hal
