// What a log says about its current sensor: offset, gain, dead band and clipping, each with its standard deviation, or
// why it cannot be seen and what would show it.
//
//   reading = (1 + gain) * current + offset
//
// With readings of a trusted meter (current_ref_a) all four are measured. Without them the cell is the reference: the
// charge that its voltage shows is compared with the charge that was counted. That finds the offset. If the cell file
// is not good enough for it, the reading at rest is the offset, if no current flows then. A wrong gain looks like
// another capacity, so the gain is visible only if the capacity of the cell file was measured with another instrument,
// whose accuracy the user states.
#pragma once

#include <optional>
#include <string>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

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
  bool by_reference = false;  ///< by a trusted meter, not by the cell
  SensorFinding offset_a;     ///< reading at a current of 0
  SensorFinding gain;         ///< as a fraction
  SensorFinding dead_band_a;  ///< below this current the reading is 0
  SensorFinding clipping_a;   ///< the largest reading, if the current goes beyond it; its sign is that of the current
  double missed_a = 0;        ///< mean current beyond the largest reading while it is clipped
  double largest_reading_a = 0;
  std::optional<double> residual_v;  ///< RMS of what the cell file leaves unexplained; by the cell only
};

/// capacity_sigma: standard deviation of the cell file's capacity as a fraction, if another instrument measured it.
/// Without readings of a trusted meter the recording needs a voltage.
Ammeter examine_ammeter(const measurement::Recording& recording, const files::CellFile& cell,
                        const std::optional<double>& capacity_sigma);

/// The correction: current = reading * (1 + gain_correction) + offset_correction_a. Only what is larger than two
/// standard deviations is corrected.
struct AmmeterCorrection {
  double gain = 0, offset_a = 0;
  bool empty() const { return gain == 0 && offset_a == 0; }
  double of(double reading_a) const { return reading_a * (1 + gain) + offset_a; }
};
AmmeterCorrection correction_of(const Ammeter& ammeter);

}  // namespace bms::workflow
