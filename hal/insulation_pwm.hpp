// Meaning of the output of a Bender IR155-3203, -3204, -3210 (data sheet D00115, measuring and fault signals): a pulse
// whose frequency is the state, and whose share of high level is the resistance.
//
//   10 Hz  measured       R = 0.9 * 1.2 Mohm / (share - 0.05) - 1.2 Mohm, for shares of 5 to 95 %
//   20 Hz  undervoltage   the same: most limits of it lie above 60 V
//   30 Hz  first estimate after power-on: 5 to 10 % good, 90 to 95 % bad
//   40 Hz  device error, 50 Hz earth connection broken: no value
//   0 Hz   off, or the wire is shorted: no value
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::hal::insulation_pwm {

inline constexpr std::int32_t most_ohm = 50'000'000;  ///< the range of the device

/// period, high: times of a pulse in units of 10 us. Returns ohms, or no_reading.
constexpr std::int32_t ohm_of(std::uint32_t period, std::uint32_t high) {
  constexpr std::int32_t source_ohm = 1'200'000;
  const auto is = [period](std::uint32_t nominal) { return period > nominal / 20 * 19 && period < nominal / 20 * 21; };
  if (high >= period) return measurement::no_reading;
  const auto share_ppm = static_cast<std::int32_t>(std::uint64_t{high} * 1'000'000 / period);
  if (is(3'333)) {
    if (share_ppm > 850'000) return 0;
    return share_ppm < 150'000 ? most_ohm : measurement::no_reading;
  }
  if (!is(10'000) && !is(5'000)) return measurement::no_reading;
  const std::int32_t above_ppm = share_ppm - 50'000;
  if (above_ppm <= 1'080'000 / 51) return most_ohm;
  const std::int64_t ohm = std::int64_t{source_ohm} * 900'000 / above_ppm - source_ohm;
  return ohm < 0 ? 0 : static_cast<std::int32_t>(ohm);
}

}  // namespace bms::hal::insulation_pwm
