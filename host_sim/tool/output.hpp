// Where results go: the part that all commands do in the same way.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "files/text_file.hpp"
#include "tool/progress.hpp"

namespace bms::tool {

struct Output {
  std::string json;    ///< file; "-" for standard output; empty: not written
  std::string report;  ///< HTML file; empty: not written
  bool quiet = false;  ///< no summary on standard output
  std::string own;     ///< the command's own file (--out, --trace); "-" for standard output

  /// Sets the command's own file. Throws BadInput if more than one result goes to standard output.
  void set_own(const std::string& file);
  /// Throws BadInput if a result would overwrite one of the `inputs`, also through a link, or another result. To be
  /// called after set_own() and before anything is written. more: further files that the command writes.
  void protect(const std::vector<std::string>& inputs, const std::vector<std::string>& more = {}) const;
  bool uses_standard_output() const { return json == "-" || report == "-" || own == "-"; }
};

/// Writes `text` to the file, or to standard output for "-". Throws BadInput when it cannot be written.
void write_output(const std::string& file, const std::string& text);
/// The same for a text that is produced piece by piece.
void write_output(const std::string& file, const std::function<void(const files::Sink&)>& produce);

/// Prints a summary for a person, unless --quiet is given or standard output carries a result. Throws BadInput when it
/// cannot be printed.
void print_summary(const Output& output, const std::string& text);

/// Throws BadInput if something that was printed on standard output did not get there: a full disk, a closed pipe.
void check_standard_output();

/// Prints a warning as one line on standard error.
void warn(const std::string& text);

}  // namespace bms::tool
