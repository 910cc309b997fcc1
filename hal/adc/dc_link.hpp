// Conversion of converter counts to the voltages of the DC link and to the current of a Hall sensor.
//
//   supply    = 3.3 V * reference_at_3v3 / reference                internal reference, same converter (RM0090, 13.10)
//   voltage   = supply * (counts / 4095 * (1 + 2 u / d) - u / d)    divider: u from the pole to the pin, d from the pin
//               to the negative end of the cells and d to the supply. From -59 to 62 V, with the u of more than 16
//               cells from -118 to 121 V; beyond, the end of the range
//   current   = (supply * counts / 4095 - 1.65 V) / sensitivity     Hall sensor; off by its offset
//
// Supplies outside 2.4 to 3.6 V give no readings. Errors: README.md of boards/stm32f405_forklift. Integers only; no
// division but one of 32 bits.
#pragma once

#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: pack_cells
#include "measurement/sample.hpp"

namespace bms::hal::adc {

inline constexpr std::uint32_t link_conversions = 8, hall_conversions = 8, reference_conversions = 4;

/// reference: sum of reference_conversions counts. Returns 0 for a supply that is not possible [uV].
constexpr std::int32_t supply_uv(std::uint32_t reference, std::uint32_t reference_at_3v3) {
  if (reference == 0) return 0;
  const std::uint32_t uv = 100 * (33'000 * reference_conversions * reference_at_3v3 / reference);
  return uv >= 2'400'000 && uv <= 3'600'000 ? static_cast<std::int32_t>(uv) : 0;
}

/// sum: of link_conversions counts [uV].
constexpr std::int32_t link_uv(std::uint32_t sum, std::int32_t supply) {
  constexpr bool large = pack_cells > 16;  // then the voltage over the supply needs a bit more
  constexpr int fraction_bits = large ? 25 : 26;
  constexpr double upper_ohm = large ? 2e6 : 1e6, lower_ohm = 56e3, share = upper_ohm / lower_ohm,
                   one = 1 << fraction_bits;
  constexpr auto per_count = static_cast<std::uint32_t>(one * (1 + 2 * share) / (4'095 * link_conversions) + 0.5),
                 bias = static_cast<std::uint32_t>(one * share + 0.5);
  const auto of_supply = static_cast<std::int32_t>(sum * per_count - bias);
  return static_cast<std::int32_t>(std::int64_t{of_supply} * supply >> fraction_bits);
}

/// Current of a Hall sensor of 2.5 V and 2.5 mV/A, divided from 5 V to 3.3 V [uA]. sum: of hall_conversions counts.
constexpr std::int32_t hall_ua(std::uint32_t sum, std::int32_t supply) {
  constexpr double v_per_a = 2.5e-3 * 33 / 50, one = 1 << 20;
  constexpr auto per_count = static_cast<std::uint32_t>(one / (4'095 * hall_conversions * v_per_a) + 0.5);
  return static_cast<std::int32_t>((std::int64_t{sum * per_count} * supply >> 20) - 1'000'000'000);
}

}  // namespace bms::hal::adc
