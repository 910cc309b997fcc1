// The reference temperature of an identified cell file: its mechanisms follow it.
#pragma once

#include "files/cell_file.hpp"

namespace bms::workflow {

/// The tables have been identified at the reference temperature of the cell: the mechanisms that the file had before
/// take it as theirs. ocv_identified: also that of the OCV.
void state_reference(files::CellFile& cell, bool ocv_identified);

}  // namespace bms::workflow
