// Writes recordings: the project's own CSV, and the Battery Data Format (BDF) if the name ends in .bdf or .bdf.csv.
#pragma once

#include <string>

#include "measurement/recording.hpp"

namespace bms::files {

/// Returns true for names that end in .bdf or .bdf.csv.
bool is_bdf_name(const std::string& path);

/// Returns true if the reader has changed or left out something that the file had.
bool is_repair(const measurement::Warning& warning);

/// Writes the columns that are not empty, and Recording::others under the names of the format. Numbers have the digits
/// that identify the double, so that reading them again gives the same bits. Repairs of the
/// reader are comments at the top of a CSV; the Battery Data Format has no comments. Throws BadInput if the file cannot
/// be written.
void write_recording(const measurement::Recording& recording, const std::string& path, bool bdf);

}  // namespace bms::files
