// What protection has to know of a pack: the limits of its cells, how many, which sensors it has, what hangs on its
// contactors. Doubles in SI units, as cell files hold them; everything derived from it is an integer and made in the
// compiler.
#pragma once

#include <algorithm>
#include <cstdint>

#include "model/cell_parameters.hpp"

namespace bms::protection {

struct PackDesign {
  model::Limits limits;  ///< of a cell
  double capacity_ah;
  std::uint8_t cells = 16;
  std::uint8_t temperatures = 1;  ///< sensors fitted, the first of PackSample's
  double sample_period_s = 0.1;
  double start_s =
      3;  ///< for the measuring chain to give its first sample (a BQ76952: 1.2 s with a reset and its settings)
  double precharge_time_constant_s =
      0.5;                            ///< pre-charge resistor times the capacitance of the link, e.g. 50 ohm and 10 mF
  double dc_link_discharge_s = 5;     ///< within which the link falls by an eighth when nothing feeds it
  double rest_current_c_rate = 0.02;  ///< below that no current flows: four offsets of a 0.5 % sensor
  double bleed_ohm = 33;              ///< of a balancing resistor
  bool neighbours_may_bleed =
      false;  ///< of one monitoring chip at the same time (its datasheet; heat and shared wires)
  double bleed_temperature_max_c = 55;  ///< no bleeding with a cell warmer than that
};

constexpr std::int32_t in_micro(double value) {
  return static_cast<std::int32_t>(value * 1e6 + (value < 0 ? -0.5 : 0.5));
}
constexpr std::int32_t in_centi(double value) {
  return static_cast<std::int32_t>(value * 1e2 + (value < 0 ? -0.5 : 0.5));
}
constexpr std::int32_t magnitude(std::int32_t value) { return std::max(value, -value); }
constexpr std::uint32_t in_us(double seconds) { return static_cast<std::uint32_t>(seconds * 1e6 + 0.5); }

}  // namespace bms::protection
