#include "tool/options.hpp"

#include "files/cell_file.hpp"

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

std::string cell_help(const std::string& what) {
  return what + (what.empty() ? "" : ": ") + "cell file, or name of a built-in cell: " + files::cell_names();
}

}  // namespace bms::tool
