// From a recording to what is identified from: which part of it, and what is known of its state of charge.
#pragma once

#include <optional>
#include <string>

#include "identification/grey_box.hpp"
#include "measurement/recording.hpp"
#include "model/cell_parameters.hpp"

namespace bms::workflow {

/// What the user says of the state of charge at the start.
struct InitialSoc {
  std::optional<double> value;  ///< not given: soc_ref, if the recording has it
  bool estimate = false;
};

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
  std::vector<double> temperature_c;  ///< of the record's rows; empty: not recorded
  double soc_min = 1, soc_max = 0;    ///< of the samples used
};

/// A whole recording is simulated from its start, but only voltages inside the window count; where the start is to be
/// estimated, the recording begins at the window. Throws BadInput when nothing of it lies in the window.
IdentificationData identification_data(const measurement::Recording& recording, const DataOptions& options);

/// "estimate", a number, or nothing. Throws BadInput.
InitialSoc initial_soc_of(const std::string& text);

/// "HI:LO", or nothing: all. Throws BadInput that names `option`.
SocWindow window_of(const std::string& option, const std::string& text);

/// Table 3, which is for a cell of 6 Ah, for one of another size; C1 up to what a cell file may hold, for slow
/// branches.
identification::CircuitBounds circuit_bounds(double capacity_ah);

}  // namespace bms::workflow
