// Where the columns of a table are: its header line, separator, units and sign. Detected, or as the user named them.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "files/logs/log_formats.hpp"
#include "files/logs/text_lines.hpp"
#include "files/read_options.hpp"

namespace bms::files {

/// One column of a file that is used.
struct SourceColumn {
  std::size_t index = 0;  ///< in the file
  Target target;
  std::string heading;
  std::string unit;  ///< as stated; empty: not stated
  Scale scale;
  bool clock = false;  ///< times as h:mm:ss
};

/// Columns of a table that has one reading a row: whose, what and when. Indices in the file.
struct LongColumns {
  std::size_t entity = 0, state = 0, time = 0;
};

struct TableLayout {
  const LogFormat* format = nullptr;
  bool own = false;  ///< the project's own names, so nothing was detected
  char separator = ',';
  bool decimal_comma = false;
  std::vector<SourceColumn> columns;  ///< ascending by index
  std::vector<std::string> headings;  ///< of all columns
  std::vector<std::size_t> unused;    ///< indices of columns that are not used
  std::optional<std::size_t> day;     ///< index of the column with the date, if the time column has none
  std::optional<std::size_t> step;    ///< index of the number of the step, if times begin again with each
  std::optional<LongColumns> long_table;

  const SourceColumn* find(Quantity quantity) const;
  std::size_t count(Quantity quantity) const;
};

/// Reads the lines up to the header, skipping comments and the preamble of a tester. A quantity is required: time,
/// current, and with `voltage` a cell voltage. Throws BadInput if no line is a header, naming what is missing.
TableLayout find_header(TextLines& lines, const std::string& path, bool voltage, const ReadOptions& options);

/// Uses the first line of values: a row of units, the decimal comma. Returns true if the line was a row of units.
bool settle(TableLayout& layout, std::string_view line, const std::string& path, std::size_t number,
            const ReadOptions& options);

/// "table, ';' separated, decimal comma; time 'Zeit [s]' in s; ...": one line for the user.
std::string text_of(const TableLayout& layout, const ReadOptions& options, const std::string& encoding);

/// Headings with the units of the row below, as one line: "Time" and "s" are "Time (s)". Empty if the row has no units.
/// above: the row above the headings, whose first field may name the time of all devices in the headings.
std::string with_units(std::string_view above, std::string_view headings, std::string_view units, char separator);

/// The columns of a table with one reading a row, as Home Assistant writes it; nothing for another header.
std::optional<LongColumns> long_columns(const std::vector<std::string>& headings);

/// Splits a line at the separator, also if it has quotes. The parts are trimmed and without quotes.
std::vector<std::string_view> split(std::string_view line, char separator);
std::string_view trimmed(std::string_view text);
/// Text of the file for a message: short and printable.
std::string in_quotes(std::string_view text);

}  // namespace bms::files
