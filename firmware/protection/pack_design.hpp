// Design of a pack: limits and number of cells, sensors and their accuracy, DC link. Values are doubles in SI units as
// in a cell file; all derived values are integers, computed at compile time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "model/cell_parameters.hpp"
#include "model/pulse_ratings.hpp"

namespace bms::protection {

/// End of the range of a reading in microamperes.
inline constexpr double max_reading_a = 2'147;

/// Ratio of current to limit above which the current is an overload: allows for the errors of a 1 % sensor and a
/// controller.
inline constexpr double overcurrent_from = 1.05;

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
  double recovery_c_rate = 0.05;           ///< largest charge current of a pack with severe undervoltage: C/20
  /// Largest current that the sensor can measure. Beyond it, its reading stays at the end of the range.
  double current_range_a = max_reading_a;
  /// Worst-case errors of a cell's and of the pack's reading (front end at -40 to 85 degrees C, after calibration).
  double cell_error_v = 0.005, pack_error_v = 0.2;
  /// Pack and cells are read up to 63 ms apart. In this time a load that ramps to its full current within the second
  /// of row `sum mismatch` changes a cell by a sixteenth of its voltage drop, which is at most 0.16 V.
  double cell_skew_v = 0.01;
  /// Second current sensor: range, offset with its converter, and error of the gains of both sensors together (Hall
  /// sensor 2 %, front end and shunt without calibration 6 %).
  double second_current_range_a = 1'000, second_current_offset_a = 20, current_gain_error = 0.1;
  model::PulseRatings pulses = {};  ///< of one cell, if its file states any
};

/// Rounded to 1e-6, saturated at +-2,147.48.
constexpr std::int32_t in_micro(double value) {
  constexpr double most = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(std::clamp(value * 1e6 + (value < 0 ? -0.5 : 0.5), -most, most));
}
/// Rounded to 0.01.
constexpr std::int32_t in_centi(double value) {
  return static_cast<std::int32_t>(value * 1e2 + (value < 0 ? -0.5 : 0.5));
}
constexpr std::int32_t magnitude(std::int32_t value) { return std::max(value, -value); }
constexpr std::uint32_t in_us(double seconds) { return static_cast<std::uint32_t>(seconds * 1e6 + 0.5); }

/// 100 ohm per volt of the full pack (ISO 6469-3, DC), in ohm.
constexpr std::int32_t least_insulation_ohm(const PackDesign& d) {
  return static_cast<std::int32_t>(100 * d.cells * d.limits.voltage_max_v + 0.5);
}
constexpr double largest_limit_a(const PackDesign& d) {
  return std::max(d.limits.charge_current_max_a, d.limits.discharge_current_max_a);
}
/// Largest current that the sensor can measure and a reading can hold [A].
constexpr double measurable_a(const PackDesign& d) { return std::min(d.current_range_a, max_reading_a); }
/// Current that counts as a short circuit: five times the continuous limit, but within the range of the sensor. A tenth
/// of the range is left for the errors of its gain, or less for a pack of more than 1,800 A.
constexpr double short_circuit_a(const PackDesign& d) {
  return std::min(5 * largest_limit_a(d), std::max(0.9 * measurable_a(d), overcurrent_from * largest_limit_a(d)));
}
/// Returns true if a short circuit is within the range of the current sensor. Firmware for a design without it is not
/// built. Up to 1,290 A overloads of 1.5 times the continuous limit are carried for their time; of larger packs, those
/// above the range count as a short circuit.
constexpr bool current_sensor_suffices(const PackDesign& d) { return short_circuit_a(d) <= 0.99 * measurable_a(d); }

}  // namespace bms::protection
