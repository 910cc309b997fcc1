// Reads recordings from CSV.
//
//   time_s,current_a,voltage_v[,temperature_c][,soc_ref][,current_ref_a][,voltage_ref_v]
//
// The header names the columns, in any order; unknown columns are ignored. The separator is ',' or ';'. A line that
// starts with '#' is a comment. 'nan' is a missing reading. The reference columns may be empty in a row.
// measurement/recording.hpp says what the columns mean.
//
// Rejected with BadInput: a missing column, a field that is not a number, a reading beyond +-1e9, time that decreases
// or never increases, fewer than 10 rows or more than measurement::most_rows, an empty file, a binary file. What looks
// wrong but can be used becomes a warning (measurement/recording_checks.hpp).
#pragma once

#include <string>

#include "measurement/recording.hpp"

namespace bms::files {

/// A profile has no voltage: it is a current to apply to a cell.
enum class VoltageColumn { required, optional };

/// Throws BadInput if the file cannot be read or is not a recording.
measurement::Recording read_recording(const std::string& path, VoltageColumn voltage = VoltageColumn::required);

/// Parses the text of a recording; `path` is for messages only. Throws BadInput.
measurement::Recording parse_recording(const std::string& text, const std::string& path,
                                       VoltageColumn voltage = VoltageColumn::required);

}  // namespace bms::files
