// The offset and the gain of a current sensor from the voltage of the cell.
#pragma once

#include <vector>

#include "ammeter/ammeter.hpp"
#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::ammeter {

struct AmmeterByCell {
  SensorFinding offset_a;       ///< of the charge balance: the sensor's, if the cell loses no charge
  Uncertain gain_and_capacity;  ///< gain that the charge balance shows if the capacity is exact
  bool gain_visible = false;    ///< the log says more about it than what was assumed
  double residual_v = 0;        ///< RMS
  double r0_times = 1;          ///< found R0 over that of the cell file
  std::vector<double> error_v;  ///< measured minus simulated voltage with the found values, for each row
};

/// Least squares over the measured voltage with five unknowns: initial state of charge, offset, gain, and a factor for
/// each of R0 and R1, which age. What the cell file does not promise is correlated noise: errors of the OCV along the
/// state of charge, of the relaxation over an hour, of the model over minutes.
AmmeterByCell ammeter_by_cell(const measurement::Recording& recording, const files::CellFile& cell);

}  // namespace bms::ammeter
