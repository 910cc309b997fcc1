#include "tool/options.hpp"

#include <fmt/format.h>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/logs/frame_log.hpp"
#include "files/logs/log_formats.hpp"
#include "measurement/recording_checks.hpp"

namespace bms::tool {

Within::Within(double low, double high) {
  name_ = "from " + CLI::detail::to_string(low) + " to " + CLI::detail::to_string(high);
  func_ = [low, high, range = name_](std::string& input) -> std::string {
    double value = 0;
    const bool inside = CLI::detail::lexical_cast(input, value) && value >= low && value <= high;
    return inside ? "" : "'" + input + "' is not acceptable, expected a number " + range;
  };
}

const CLI::Validator& not_empty() {
  static const CLI::Validator validator(
      [](std::string& name) { return name.empty() ? std::string("an empty name, expected a file") : std::string(); },
      "FILE");
  return validator;
}

void add_json(CLI::App& command, Output& output, const std::string& quiet) {
  command.add_option("--json", output.json, "write the result as one JSON object to FILE, '-' for standard output")
      ->check(not_empty())
      ->type_name("FILE");
  command.add_flag("--quiet", output.quiet, quiet);
}

void add_output(CLI::App& command, Output& output) {
  add_json(command, output);
  command.add_option("--report", output.report, "write a page with plots to FILE.html")
      ->check(not_empty())
      ->type_name("FILE");
}

void add_reading(CLI::App& c, files::ReadOptions& o) {
  const std::string group = "How recordings are read (docs/log_formats.md)";
  o.refuse_doubtful = true;
  const auto list = [&](const char* name, std::vector<std::string>& values, const char* help, const char* type) {
    c.add_option(name, values, help)->type_name(type)->expected(1)->take_all()->group(group);
  };
  list("--map", o.map, "which column is current_a, voltage_v, v_1 and so on; of CAN frames which signal",
       "NAME=COLUMN");
  c.add_option("--map-file", o.map_file, "file with such lines")->type_name("FILE")->group(group);
  list("--unit", o.unit, "unit of a column: ms, min, mA, mV, K, %", "NAME=UNIT");
  auto* inverted = c.add_flag_callback(
      "--discharge-positive", [&o] { o.sign = files::CurrentSign::discharge_positive; },
      "the current in the file is positive while discharging");
  c.add_flag_callback(
       "--charge-positive", [&o] { o.sign = files::CurrentSign::charge_positive; },
       "the current in the file is positive while charging, although the voltage suggests otherwise")
      ->excludes(inverted)
      ->group(group);
  inverted->group(group);
  c.add_option("--format", o.format, "format of the file, if it is not detected: " + files::log_format_names())
      ->type_name("NAME")
      ->group(group);
  c.add_option("--separator", o.separator, "between columns: one character, or tab")->type_name("CHAR")->group(group);
  c.add_flag("--decimal-comma", o.decimal_comma, "numbers as 3,3")->group(group);
  c.add_flag("--day-first", o.day_first, "dates as 31/12/2026")->group(group);
  c.add_option("--steps", o.steps, "only rows of these steps of a tester: 3:7")->type_name("A:B")->group(group);
  c.add_option("--cycles", o.cycles, "only rows of these cycles of a tester: 1:2")->type_name("A:B")->group(group);
  c.add_option("--dbc", o.dbc, "DBC file of the frames of a CAN log, or pylontech for batteries with such frames")
      ->type_name("FILE")
      ->group(group);
  c.add_option("--channel", o.channel, "channel of a CAN log with several: can0, 1")->type_name("NAME")->group(group);
  c.add_option("--series", o.cells_in_series, "cells in series, to get a cell's voltage from pack_voltage_v")
      ->type_name("N")
      ->check(CLI::Range(1, 1'000))
      ->group(group);
}

void complete_reading(files::ReadOptions& o) {
  if (o.map_file.empty()) return;
  const std::vector<std::string> map = files::read_map_file(o.map_file);
  o.map.insert(o.map.end(), map.begin(), map.end());
  o.map_file.clear();
}

void print_read_as(const Output& output, const measurement::Recording& recording) {
  if (output.quiet || recording.read_as.empty()) return;
  fmt::print(stderr, "{}\n", files::printable(recording.path + ": " + recording.read_as));
}

void print_note(const Output& output, const std::string& text) {
  if (!output.quiet) fmt::print(stderr, "{}\n", files::printable(text));
}

void refuse_contradiction(const measurement::Recording& recording) {
  const std::string what = measurement::contradiction(recording);
  if (!what.empty()) throw files::BadInput(recording.path, 1, what);
}

std::string cell_help(const std::string& what) {
  return what + (what.empty() ? "" : ": ") + "cell file, or name of a built-in cell: " + files::cell_names();
}

}  // namespace bms::tool
