// What a log says about its current sensor: offset, gain, dead band and clipping, each with its standard deviation, or
// why it cannot be seen and what would show it.
//
//   reading = (1 + gain) * current + offset
//
// With readings of a trusted meter (current_ref_a) all four are measured. Without them the cell is the reference: the
// charge that its voltage shows is compared with the charge that was counted. A balance that is short does not show the
// sensor's offset: a leakage or an internal short circuit of the cell and a lost capacity make it short as well. What
// the sensor reads while no current flows decides: with open contactors, or at the rests of the log. A wrong gain looks
// like another capacity, so the gain is visible only if the capacity of the cell file was measured with another
// instrument, whose accuracy the user states.
#pragma once

#include <optional>
#include <string>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::ammeter {

struct Uncertain {
  double value = 0, std = 0;
};

/// A value of the sensor, or why it is missing.
struct SensorFinding {
  std::optional<Uncertain> value;
  std::string why;  ///< without a value: why, and what would show it; with one: a remark, or empty
};

/// "-25 mA", "1.30 A".
std::string amperes(double a);

struct Ammeter {
  bool by_reference = false;     ///< by a trusted meter, not by the cell
  SensorFinding offset_a;        ///< reading at a current of 0
  SensorFinding balance_a;       ///< counted less than what the voltage shows, as a current; by the cell only
  bool open_contactors = false;  ///< offset_a was read while no current could flow
  SensorFinding gain;            ///< as a fraction
  SensorFinding dead_band_a;     ///< below this current the reading is 0
  std::string silent;            ///< where the reading is 0 under load; empty: nowhere
  SensorFinding clipping_a;  ///< the largest reading, if the current goes beyond it; its sign is that of the current
  double missed_a = 0;       ///< mean current beyond the largest reading while it is clipped
  double largest_reading_a = 0;
  std::optional<double> residual_v;  ///< RMS of what the cell file leaves unexplained; by the cell only
};

/// capacity_sigma: standard deviation of the cell file's capacity as a fraction, if another instrument measured it.
/// open_contactors: a recording of the same sensor while no current can flow, of which only the current is read.
/// Without readings of a trusted meter the recording needs a voltage.
Ammeter examine_ammeter(const measurement::Recording& recording, const files::CellFile& cell,
                        const std::optional<double>& capacity_sigma,
                        const measurement::Recording* open_contactors = nullptr);

/// What a charge balance says about the sensor.
enum class Balance {
  missing,    ///< it is not visible
  balanced,   ///< within two standard deviations of zero
  by_sensor,  ///< the sensor reads as much while no current flows
  by_cell,    ///< the sensor reads zero while no current can flow, or another value: the cell is the cause
  undecided   ///< sensor or cell
};
Balance balance_of(const Ammeter& ammeter);

/// The correction: current = reading * (1 + gain_correction) + offset_correction_a. Only what is larger than two
/// standard deviations is corrected, and nothing while the charge balance leaves open whether the sensor or the cell is
/// the cause: a correction would hide an internal short circuit.
struct AmmeterCorrection {
  double gain = 0, offset_a = 0;
  bool empty() const { return gain == 0 && offset_a == 0; }
  double of(double reading_a) const { return reading_a * (1 + gain) + offset_a; }
};
AmmeterCorrection correction_of(const Ammeter& ammeter);

}  // namespace bms::ammeter
