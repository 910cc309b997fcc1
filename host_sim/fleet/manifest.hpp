// Which recordings a depot has. A manifest is a folder, a pattern, or a table:
//
//   recording,cell,truck,cell_index,started_at
//
// Only `recording` is required. Paths are relative to the table's folder; `cell` may be a built-in cell. A folder, with
// the folders in it, or a pattern stands for its files *.csv and *.csv.gz: their truck is the name of the folder that
// contains them. A table of 24,000 recordings is read line by line and is never in memory as a whole.
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace bms::fleet {

/// One recording of one cell: what one process works on.
struct Unit {
  std::string recording;        ///< absolute path
  std::string cell = "table9";  ///< absolute path of a cell file, or a built-in cell
  std::string truck;            ///< any text; empty: not known
  std::string cell_index;       ///< of the cell in the truck, usually 1 to N; empty: not known
  std::string started_at;       ///< ISO 8601 date, with or without a time; empty: not known
};

/// Seconds since 1970-01-01 of started_at. Nothing for another text.
std::optional<double> started_s(const std::string& date);

/// Fields of a line of a table. A field with a separator, a quote or a line end stands in double quotes.
std::vector<std::string> fields_of(const std::string& line);
/// The field as a table has it.
std::string csv_field(const std::string& text);

/// Calls `use` for each unit of a manifest, in its order. default_cell: of units that name no cell. Throws BadInput: no
/// recording at all, a recording named twice, an invalid date, a bad header.
void read_manifest(const std::string& manifest, const std::string& default_cell,
                   const std::function<void(const Unit&)>& use);

/// Writes a manifest as a table of absolute paths. Returns the number of its units. Throws BadInput.
std::size_t write_manifest(const std::string& manifest, const std::string& default_cell,
                           const std::filesystem::path& table);

/// Name of the unit's results in a folder: 16 hexadecimal digits that depend on recording and cell alone.
std::string key_of(const Unit& unit);

}  // namespace bms::fleet
