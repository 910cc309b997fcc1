// Resistances of the current pulses of a recording (DCIR, as of an HPPC test): voltage steps divided by current steps,
// without a model. They include what the open-circuit voltage moves during the pulse.
//
// A pulse begins after a rest of at least 10 s (|current| below C/50) with a current above C/10 that stays within 3 %.
// Row k has the mean current of the interval that ends at its time, so a pulse begins at the time of the row before; a
// first row with part of the current places it inside the interval.
#pragma once

#include <vector>

#include "measurement/recording.hpp"

namespace bms::measurement {

struct PulseReading {
  double after_s = 0;  ///< since the pulse began
  double voltage_v = 0;
  double resistance_ohm = 0;  ///< (voltage - start voltage) / current step
};

struct Pulse {
  double begin_s = 0;            ///< in the recording's clock
  double duration_s = 0;         ///< to its last row
  double soc = 0;                ///< at its beginning; NaN: unknown
  double temperature_c = 0;      ///< at its beginning; NaN: not recorded
  double current_a = 0;          ///< mean of its rows; > 0 charges
  double start_voltage_v = 0;    ///< last reading of the rest
  double end_voltage_v = 0;      ///< last reading of the pulse
  std::vector<PulseReading> at;  ///< after 1, 10 and 30 s, as far as it lasts, and at the end of one of up to 120 s

  bool charges() const { return current_a > 0; }
  /// Its reading after this time, or null.
  const PulseReading* after(double seconds) const;
};

/// Where the state of charge of a recording is known. NaN: nowhere.
struct KnownSoc {
  double time_s = 0, soc = 0;
};

/// The pulses of a recording of one cell, in order. The state of charge is soc_ref, or else counted from `known` with
/// capacity_ah (> 0).
std::vector<Pulse> pulses_of(const Recording& recording, double capacity_ah, const KnownSoc& known);

}  // namespace bms::measurement
