// The reference temperature of an identified cell file: its resistances and its mechanisms follow it.
#pragma once

#include "files/cell_file.hpp"

namespace bms::workflow {

/// The tables have been identified at the reference temperature of the cell: the mechanisms that the file had before
/// take it as theirs. ocv_identified: also that of the OCV.
void state_reference(files::CellFile& cell, bool ocv_identified);

/// Expresses R0 and R1 at temperature_c instead of at the reference of the mechanism temperature_resistance, so that
/// the model's voltage stays the same, and sets the reference of this mechanism. C1 does not depend on the temperature.
/// Does nothing to a cell without the mechanism.
void move_resistances(files::CellFile& cell, double temperature_c);

}  // namespace bms::workflow
