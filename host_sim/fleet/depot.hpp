// The folder of a depot's results:
//
//   depot.json           task, its arguments, pages wanted
//   manifest.csv         all units, with absolute paths
//   results/12/KEY.json  of a finished unit: what the tool said, and what it was run with
//   pages/12/KEY.html    the report of a recording
//   cells/12/KEY.toml    task identify: the identified cell
//   fleet.sqlite, .csv   the merged table
//
// A unit is finished when its result file exists and was written by the same version with the same arguments from the
// same cell file, later than the recording. A result file is written under another name, forced to the disk and
// renamed: it is there completely or not at all, and of two copies of a unit either may win.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "fleet/manifest.hpp"

namespace bms::fleet {

enum class Task { replay, identify, diagnose };
inline constexpr const char* task_names[] = {"replay", "identify", "diagnose"};
inline const char* name_of(Task task) { return task_names[static_cast<int>(task)]; }
/// Throws BadInput for another name.
Task task_of(const std::string& name);

/// Which recordings have a page of their own.
enum class Pages { all, found, none };
inline constexpr const char* pages_names[] = {"all", "found", "none"};
inline const char* name_of(Pages pages) { return pages_names[static_cast<int>(pages)]; }

struct Depot {
  std::filesystem::path folder;
  Task task = Task::replay;
  std::vector<std::string> arguments;  ///< passed to the task
  Pages pages = Pages::all;
  std::string version;  ///< of this tool

  std::filesystem::path manifest() const { return folder / "manifest.csv"; }
  std::filesystem::path result(const std::string& key) const { return at("results", key, ".json"); }
  std::filesystem::path page(const std::string& key) const { return at("pages", key, ".html"); }
  std::filesystem::path identified(const std::string& key) const { return at("cells", key, ".toml"); }

 private:
  std::filesystem::path at(const char* kind, const std::string& key, const char* end) const {
    return folder / kind / key.substr(0, 2) / (key + end);
  }
};

/// Creates the folder, or checks that it holds results of the same task with the same arguments. Throws BadInput.
void open_depot(const Depot& depot);
/// Reads depot.json. Throws BadInput if the folder is not one of a depot.
Depot read_depot(const std::filesystem::path& folder, const std::string& version);

/// Arguments of the tool for a unit, without its program. json: "-" prints it. page: empty for none.
std::vector<std::string> arguments_of(const Depot& depot, const Unit& unit, const std::string& json,
                                      const std::string& page, const std::string& identified);
/// Quotes what a shell would not take as one word.
std::string shell_word(const std::string& text);
/// A command that repeats a unit, for a shell.
std::string command_of(const Depot& depot, const Unit& unit);

/// SHA-256 of a cell file's text, or of the built-in cell's; empty if it cannot be read.
std::string cell_hash(const std::string& cell);

/// Returns true if the unit has a result that need not be computed again.
bool is_finished(const Depot& depot, const Unit& unit);

}  // namespace bms::fleet
