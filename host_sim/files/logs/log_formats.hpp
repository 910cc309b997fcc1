// The table formats of testers and loggers, and the names that they give to columns. Facts from public specifications
// and from published example files; docs/log_formats.md lists what is read.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "files/logs/units.hpp"

namespace bms::files {

struct LogFormat {
  std::string_view name;   ///< of --format
  std::string_view title;  ///< for the user
  /// Headings, normalised; a header with one of them is of this format. Separated by '|'.
  std::string_view marks;
  bool base_units = false;          ///< A and V where a heading states no unit
  bool state_column = false;        ///< the current has no sign; a state 'D' discharges
  std::string_view time_unit = {};  ///< of times whose heading states none
  std::string_view cell_unit = {};  ///< of cells whose heading states none
};

/// In the order in which they are tried. The last is any table whose headings state their units.
std::span<const LogFormat> log_formats();
/// nullptr for an unknown name.
const LogFormat* log_format(std::string_view name);
/// Names for a message, also those of CAN logs.
std::string log_format_names();

/// Rank of a heading as a name of the quantity, 0 the best; -1: it is not one. base: Heading::base.
int rank_of(Quantity quantity, std::string_view base);
/// The number K of "cell 3 voltage", "vcell3", "v 3", "t 2"; 0 for another heading.
std::size_t cell_number(Quantity quantity, std::string_view base);

/// Names of the Battery Data Format: a column of a recording as heading, and back. Empty: the format has none.
std::string bdf_label(std::string_view column);
/// Machine-readable name of a heading of the format, "Cycle Count / 1" -> "cycle_count"; the text itself otherwise.
std::string machine_name(const std::string& label);
/// The heading for a machine-readable name; the name itself if the format does not have it.
std::string label_of_machine_name(const std::string& name);

}  // namespace bms::files
