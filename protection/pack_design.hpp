// Design of a pack: limits and number of cells, sensors, DC link. Values are doubles in SI units as in a cell file; all
// derived values are integers, computed at compile time.
#pragma once

#include <algorithm>
#include <cstdint>

#include "model/cell_parameters.hpp"

namespace bms::protection {

struct PackDesign {
  model::Limits limits;  ///< limits of one cell
  double capacity_ah;
  std::uint8_t cells = 16;
  std::uint8_t temperatures = 1;  ///< fitted sensors, the first ones of PackSample
  double sample_period_s = 0.1;
  double start_s = 3;  ///< until the first sample of the measuring chain (BQ76952: 1.2 s with a reset and its settings)
  /// Main plus closes when pack and DC link differ by at most the product: current that it may make, and resistance of
  /// pack, cables and DC-link capacitor.
  double closing_current_max_a = 600, closing_loop_ohm = 0.015;
  /// Measured and precharged. false: a single switch for a load without capacitor.
  bool dc_link = true;
  double precharge_time_constant_s = 0.5;  ///< precharge resistor x capacitance of the DC link, e.g. 50 ohm x 10 mF
  double rest_current_c_rate = 0.02;       ///< below it the current counts as zero: four offsets of a 0.5 % sensor
  double bleed_ohm = 33;                   ///< balancing resistor
  bool neighbours_may_bleed = false;       ///< allowed by the monitoring chip (its data sheet; heat, shared wires)
  double bleed_temperature_max_c = 55;     ///< no balancing with a warmer cell
};

/// Rounded to 1e-6.
constexpr std::int32_t in_micro(double value) {
  return static_cast<std::int32_t>(value * 1e6 + (value < 0 ? -0.5 : 0.5));
}
/// Rounded to 0.01.
constexpr std::int32_t in_centi(double value) {
  return static_cast<std::int32_t>(value * 1e2 + (value < 0 ? -0.5 : 0.5));
}
constexpr std::int32_t magnitude(std::int32_t value) { return std::max(value, -value); }
constexpr std::uint32_t in_us(double seconds) { return static_cast<std::uint32_t>(seconds * 1e6 + 0.5); }

}  // namespace bms::protection
