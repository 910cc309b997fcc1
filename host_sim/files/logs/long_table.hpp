// Tables with one reading a row, as Home Assistant exports a history: entity_id,state,last_changed. A row of the
// recording has the last reading of each entity; readings within a second are one row.
#pragma once

#include <string>

#include "files/logs/table_layout.hpp"
#include "files/logs/text_lines.hpp"
#include "files/read_options.hpp"
#include "measurement/recording.hpp"

namespace bms::files {

/// Reads the rows below the header. Entities are those of --map, or are found by the ends of their names
/// ("sensor.bms_cell_voltage_1"). Without --unit they are in A, V and degrees C. Throws BadInput.
measurement::Recording read_long_table(TextLines& lines, const TableLayout& layout, const std::string& path,
                                       const ReadOptions& options);

}  // namespace bms::files
