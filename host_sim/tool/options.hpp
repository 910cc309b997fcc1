// Options that several commands share.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

#include "files/read_options.hpp"
#include "measurement/recording.hpp"
#include "tool/output.hpp"

namespace bms::tool {

/// Accepts a number from `low` to `high`, both included. CLI::Range accepts nan as well.
struct Within : CLI::Validator {
  Within(double low, double high);
};

/// Refuses an empty file name.
const CLI::Validator& not_empty();

/// --json and --quiet.
void add_json(CLI::App& command, Output& output, const std::string& quiet = "print no summary");
/// --json, --report and --quiet.
void add_output(CLI::App& command, Output& output);

/// How recordings are read: --map, --unit, --discharge-positive, --format and the others of files::ReadOptions.
/// Doubtful readings are errors.
void add_reading(CLI::App& command, files::ReadOptions& options);
/// Adds the lines of --map-file to `map`. To be called before a recording is read.
void complete_reading(files::ReadOptions& options);
/// Prints what was detected in a recording, if it is not in the project's own format.
void print_read_as(const Output& output, const measurement::Recording& recording);
/// Prints on stderr what a user may want to know and need not act on, unless the output is quiet.
void print_note(const Output& output, const std::string& text);
/// Throws BadInput if the readings contradict the cell that they were compared with.
void refuse_contradiction(const measurement::Recording& recording);

/// `what`, followed by what is accepted: a file, or one of the built-in cells.
std::string cell_help(const std::string& what = "");

}  // namespace bms::tool
