// From a recording to a data set for identification: which part is used, and what is known of its initial state.
#pragma once

#include <optional>
#include <string>

#include "files/recording.hpp"
#include "identification/grey_box.hpp"
#include "model/cell_parameters.hpp"

namespace bms::workflow {

/// The user's statement about the state of charge at the start.
struct InitialSoc {
  std::optional<double> value;  ///< not given: soc_ref if the recording has it, else estimated
  bool estimate = false;
};

/// Range of the state of charge whose samples count. The default is everything.
struct SocWindow {
  double high = 2, low = -2;
};

struct DataOptions {
  InitialSoc initial;
  SocWindow window;
  model::CellParameters<> cell;
};

struct IdentificationData {
  identification::DataSet record;
  measurement::Column temperature_c;  ///< by row of the data set; empty: not recorded
  double soc_min = 1, soc_max = 0;    ///< of the samples that count
};

/// The recording is simulated from its start, but only voltages inside the window count; outside they are NaN. If the
/// initial state of charge is to be estimated, the data set begins at the window. Throws BadInput if fewer than ten
/// samples lie in the window.
IdentificationData identification_data(const measurement::Recording& recording, const DataOptions& options);

/// A stretch of the recordings whose voltage does not count.
struct LeftOutTime {
  double from_s = 0, to_s = -1;  ///< in the recordings' clock; empty by default
};

/// Removes the voltage in that time; the current still flows.
void leave_out(const LeftOutTime& time, measurement::Recording& recording);

/// Removes single voltages between two that agree, under a constant current, and adds a warning with their number.
/// Many of them are noise and stay.
void leave_out_odd_readings(measurement::Recording& recording);

/// Parses "estimate", a number from 0 to 1, or an empty text. Throws BadInput.
InitialSoc initial_soc_of(const std::string& text);

/// Parses "HI:LO", or an empty text for the whole range. Throws BadInput that names `option`.
SocWindow window_of(const std::string& option, const std::string& text);

/// The bounds of the paper's Table 3, which is for 6 Ah, scaled to another capacity. C1 reaches the limit of the cell
/// file format, which slow RC branches need.
identification::CircuitBounds circuit_bounds(double capacity_ah);

}  // namespace bms::workflow
