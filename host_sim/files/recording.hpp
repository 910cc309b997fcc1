// Reads recordings from tables: the project's own CSV, and what testers and loggers write.
//
//   time_s,current_a,voltage_v[,temperature_c][,soc_ref][,current_ref_a][,voltage_ref_v][,v_1..v_N][,t_1..t_M]
//   [,pack_voltage_v]
//
// The header names the columns, in any order; unknown columns are ignored. The separator is ',', ';' or a tab. A line
// that starts with '#' is a comment. An empty field or 'nan' is a missing reading; time_s has none.
// measurement/recording.hpp says what the columns mean, ReadOptions what the user can say about a file, and
// docs/log_formats.md which other formats, names and units are read.
//
// A pack with v_1..v_N needs no voltage_v: it is then the mean of the cells, as is temperature_c of t_1..t_M.
//
// Rejected with BadInput: a missing column, a field that is not a number, a reading beyond +-1e9, time that decreases
// or never increases, fewer than 10 rows or more than measurement::most_rows, an empty file, a binary file. What looks
// wrong but can be used becomes a warning (measurement/recording_checks.hpp), unless ReadOptions::refuse_doubtful.
#pragma once

#include <string>

#include "files/read_options.hpp"
#include "measurement/recording.hpp"

namespace bms::files {

/// The largest soc_ref of a recording: that of a reference that counts charge with a small error.
inline constexpr double largest_soc_ref = 1.05;

/// A profile has no voltage: it is a current to apply to a cell.
enum class VoltageColumn { required, optional };

/// Throws BadInput if the file cannot be read or is not a recording. Of a log of CAN frames it decodes the signals that
/// the options name.
measurement::Recording read_recording(const std::string& path, VoltageColumn voltage = VoltageColumn::required,
                                      const ReadOptions& options = {});

/// Parses the text of a recording; `path` is for messages only. Throws BadInput.
measurement::Recording parse_recording(const std::string& text, const std::string& path,
                                       VoltageColumn voltage = VoltageColumn::required,
                                       const ReadOptions& options = {});

}  // namespace bms::files
