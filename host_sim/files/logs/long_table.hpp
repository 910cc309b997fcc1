// Tables with one reading a row, as Home Assistant exports a history: entity_id,state,last_changed; and the console of
// ESPHome, "[13:47:04][D][sensor:125]: 'pack current': Sending state 1.5 A with 2 decimals of accuracy". A row of the
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

/// Returns true if one of the first lines is a reading on the console of ESPHome.
bool is_console(const std::string& path);
/// Reads such a log; the units stand in its lines. Lines without a reading are skipped. Throws BadInput.
measurement::Recording read_console(const std::string& path, const ReadOptions& options, std::size_t& bytes);

}  // namespace bms::files
