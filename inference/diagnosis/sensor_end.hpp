// The end of the current sensor as both channels show it: the reading stands at its largest value while the voltage
// goes on moving. How much more flows there differs from row to row, and no reading says it. The noise of such a row
// therefore grows by SensorEnd::spread_v (LikelihoodModel): two thirds of a clipped drive's misfit were the peaks
// themselves, and it read UNKNOWN.
#pragma once

#include "diagnosis/prepared_recording.hpp"

namespace bms::diagnosis {

struct SensorEnd {
  double limit_a = 0;   ///< the largest |reading|
  double spread_v = 0;  ///< standard deviation of the voltage from row to row while the reading stands there; 0: it
                        ///< does not stand there, or the voltage does not move either, as at a constant current
  /// Returns true if the reading stands at its largest value.
  bool stands(double current_a) const;
  /// Returns true if the reading says no more than "at least this".
  bool holds(double current_a) const { return spread_v > 0 && stands(current_a); }
};

/// quiet_a: step of the current below which second differences show the voltage's noise.
SensorEnd sensor_end(const PreparedRecording& r, double quiet_a, double noise_v);

}  // namespace bms::diagnosis
