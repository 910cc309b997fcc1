// Where results go: what every command offers in the same way.
#pragma once

#include <functional>
#include <string>

#include "workflow/progress.hpp"

namespace bms::tool {

struct Output {
  std::string json;    ///< file, "-" for standard output, empty: none
  std::string report;  ///< HTML file, empty: none
  bool quiet = false;  ///< no summary on standard output
  std::string main;    ///< the command's own file (--out, --trace); "-" for standard output

  bool uses_standard_output() const { return json == "-" || report == "-" || main == "-"; }
};

/// Writes `text` to the file, or to standard output for "-". Throws BadInput when it cannot be written.
void write_output(const std::string& file, const std::string& text);

/// A summary for a person; not when quiet, nor when standard output carries a result.
void print_summary(const Output& output, const std::string& text);

/// Progress as one line of a terminal that is written over, every_s at most; nothing where standard error is no
/// terminal. line: what to show, left_s being a guess (infinite at first).
workflow::Progress progress_on_terminal(
    double every_s, std::function<std::string(double done, double left_s, const std::string& what)> line);

/// A warning: one line on standard error.
void warn(const std::string& text);

}  // namespace bms::tool
