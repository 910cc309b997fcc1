// Second line of protection: the protections of the measuring chip, which open by hardware. Bits as the front end
// reports them (hal/second_line.hpp; firmware/application.hpp checks that they are equal).
#pragma once

#include <cstdint>

namespace bms::protection::second_line {

inline constexpr std::uint32_t cell_undervoltage = 1, cell_overvoltage = 2, charge_overcurrent = 4,
                               discharge_overcurrent = 8, short_circuit = 16, temperature = 32, host_silence = 64,
                               permanent_failure = 128, pins_wrong = 256;

/// Trips that raise `second line failed`.
inline constexpr std::uint32_t failures = permanent_failure | pins_wrong;
/// Trips that raise `second line tripped`.
inline constexpr std::uint32_t trips = ~(failures | short_circuit);

}  // namespace bms::protection::second_line
