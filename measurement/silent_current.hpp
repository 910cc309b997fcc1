// A current that reads exactly 0 for a while in which the voltage shows that a load is switched: the sensor is not
// read, or the load bypasses it.
//
// What the voltage does at a step of the current is learned from the log's own other steps, dV = r dI. While the
// reading is 0, steps of the voltage beyond its noise are steps of a current that is not read.
#pragma once

#include <string>
#include <vector>

#include "measurement/recording.hpp"
#include "measurement/spans.hpp"

namespace bms::measurement {

struct SilentCurrent {
  Rows rows;                    ///< [begin, end): the reading is 0
  double from_s = 0, to_s = 0;  ///< of the recording
  std::size_t steps = 0;        ///< of the voltage meanwhile
  double step_a = 0;            ///< usual size of these steps, as a current
};

/// Of a recording with a voltage, of a cell or of all cells of a pack. Nothing without other steps of the current.
std::vector<SilentCurrent> silent_currents(const Recording& recording);

/// One sentence; empty without any.
std::string silent_current_text(const std::vector<SilentCurrent>& found, double first_s);

}  // namespace bms::measurement
