// The reference temperature of an identified cell file: its mechanisms follow it.
#pragma once

#include <vector>

#include "files/cell_file.hpp"
#include "measurement/recording.hpp"

namespace bms::workflow {

/// The tables have been identified at the reference temperature of the cell: the mechanisms that the file had before
/// take it as theirs. ocv_identified: also that of the OCV.
void state_reference(files::CellFile& cell, bool ocv_identified);

/// Reference temperature of tables that were identified at identified_c: that of the start, stated_c, or where the
/// recordings are farther from it than recordings of one temperature can be, theirs. A table of 4 degrees C that is
/// said to be of 25 makes every recording at 4 look as if its resistances had followed the temperature. Not for tables
/// that a law moves to stated_c, from recordings or slow runs at several temperatures.
double reference_of(double stated_c, double identified_c);

/// Warns if [rc] is not at the temperature that the cell file states. identified_c: temperature of its recordings.
/// moved: recordings at several temperatures have moved it there.
void check_reference(const files::CellFile& cell, double identified_c, bool moved,
                     std::vector<measurement::Warning>& warnings);

}  // namespace bms::workflow
