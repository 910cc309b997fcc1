// Tables whose rows are messages: the current in some rows, the cells in others, as a scan tool polls them.
#pragma once

#include "measurement/recording.hpp"

namespace bms::files {

/// If most readings of a voltage stand in rows without a current, the rows with the current remain, and every column
/// has the reading that is nearest in time, held until the next (host_sim/files/logs/paired_column.hpp). A warning says
/// so.
void join_row_groups(measurement::Recording& recording);

}  // namespace bms::files
