// The table of docs/log_formats.md: every sample, its command, and the tool's answer to it.
#pragma once

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/end_to_end/log_samples.hpp"
#include "tests/end_to_end/run_tool.hpp"

namespace bms::log_samples {

/// Writes the sample into the folder and imports it from there to out.csv.
inline ToolRun import_sample(const Sample& sample, const std::filesystem::path& folder) {
  std::ofstream(folder / sample.file, std::ios::binary) << sample.content;
  std::ofstream(folder / "bus.dbc", std::ios::binary) << dbc();
  const std::string err = (folder / "err").string();
  const int status = std::system(("cd '" + folder.string() + "' && '" BMS_TOOL "' import " + sample.file + " " +
                                  sample.options + " --out out.csv >out 2>err")
                                     .c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128, content(folder / "out"), content(err)};
}

/// The tool's answer in one cell of a table: what it detected, or why it refuses.
inline std::string answer_of(const Sample& sample, const ToolRun& run) {
  std::string line = run.err.substr(0, run.err.find('\n'));
  if (run.exit_code == 0 && line.starts_with("warning: ")) line = run.err.find('\n') + 1 < run.err.size() ? line : line;
  for (const std::string& name : {sample.file + ":1: ", sample.file + ": "}) {
    if (const std::size_t at = line.find(name); at != std::string::npos) line = line.substr(at + name.size());
  }
  if (line.empty()) line = "as it is";
  constexpr std::size_t longest = 230;
  if (line.size() > longest) line = line.substr(0, longest) + " ...";
  std::string cell;
  for (const char c : line) cell += c == '|' ? std::string("\\|") : std::string(1, c);
  return (run.exit_code == 0 ? "read: " : "refused: ") + cell;
}

inline std::string markdown_table() {
  std::string table = "| log | `bms import` | answer |\n|---|---|---|\n";
  for (const Sample& sample : samples()) {
    const files::TemporaryFolder folder;
    const ToolRun run = import_sample(sample, folder.path());
    table += "| " + sample.what + " | `" + sample.file + (sample.options.empty() ? "" : " " + sample.options) + "` | " +
             answer_of(sample, run) + " |\n";
  }
  return table;
}

}  // namespace bms::log_samples
