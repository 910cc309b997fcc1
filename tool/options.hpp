// Options that several commands share.
#pragma once

#include <string>

#include <CLI/CLI.hpp>

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

/// `what`, followed by what is accepted: a file, or one of the built-in cells.
std::string cell_help(const std::string& what = "");

}  // namespace bms::tool
