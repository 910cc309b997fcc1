// The columns of a recording by what they mean.
#pragma once

#include <limits>
#include <vector>

#include "files/logs/units.hpp"
#include "files/read_options.hpp"
#include "measurement/recording.hpp"

namespace bms::files {

inline constexpr double missing_value = std::numeric_limits<double>::quiet_NaN();

/// The column for this quantity, not that of a tester's state. A list of cells grows to the number.
measurement::Column& column_of(measurement::Recording& recording, const Target& target);

/// Sets the column. Columns of cells with smaller numbers that are not set have missing readings.
void put_column(measurement::Recording& recording, const Target& target, std::vector<double> values);

/// Voltage and temperature of a pack from its cells, or from the pack voltage and the number of cells, where they were
/// not recorded. Throws BadInput if there is only a pack voltage.
void complete_pack(measurement::Recording& recording, const ReadOptions& options);

}  // namespace bms::files
