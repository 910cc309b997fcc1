// The reference temperature of an identified cell file: its mechanisms follow it.
#pragma once

#include <vector>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// The tables have been identified at the reference temperature of the cell: the mechanisms that the file had before
/// take it as theirs. ocv_identified: also that of the OCV.
void state_reference(files::CellFile& cell, bool ocv_identified);

/// Warns if [rc] is not at the temperature that the cell file states. identified_c: temperature of its recordings.
/// moved: recordings at several temperatures have moved it there.
void check_reference(const files::CellFile& cell, double identified_c, bool moved,
                     std::vector<measurement::Warning>& warnings);

}  // namespace bms::workflow
