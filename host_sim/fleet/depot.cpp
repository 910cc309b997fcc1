#include "fleet/depot.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "files/bad_input.hpp"
#include "files/cell_file.hpp"
#include "files/text_file.hpp"

namespace bms::fleet {

namespace {

namespace fs = std::filesystem;
using files::BadInput;
using Json = nlohmann::ordered_json;

Json settings_of(const Depot& depot) {
  return {{"task", name_of(depot.task)}, {"arguments", depot.arguments}, {"pages", name_of(depot.pages)}};
}

}  // namespace

std::string shell_word(const std::string& text) {
  constexpr std::string_view plain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-./=:,+%@";
  if (!text.empty() && text.find_first_not_of(plain) == std::string::npos) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

Task task_of(const std::string& name) {
  for (const Task task : {Task::replay, Task::identify, Task::diagnose}) {
    if (name == name_of(task)) return task;
  }
  throw BadInput("--task", 1, "no such task '" + name + "', expected replay, identify or diagnose");
}

void open_depot(const Depot& depot) {
  for (const std::string& argument : depot.arguments) {
    for (const char* own : {"--json", "--report", "--out", "--cell", "--recording", "--start", "--trace", "--quiet"}) {
      if (argument == own || argument.starts_with(std::string(own) + "="))
        throw BadInput(argument, 1, "set by bms fleet for each recording, expected other options of the task");
    }
  }
  std::error_code error;
  fs::create_directories(depot.folder, error);
  if (error) throw BadInput(depot.folder.string(), 1, "cannot be made (" + error.message() + "), expected a folder");
  const fs::path settings = depot.folder / "depot.json";
  if (fs::exists(settings)) {
    const Depot before = read_depot(depot.folder, depot.version);
    if (before.task != depot.task || before.arguments != depot.arguments)
      throw BadInput(depot.folder.string(), 1,
                     fmt::format("holds results of the task {} with other arguments, expected another folder for {}",
                                 name_of(before.task), name_of(depot.task)));
    if (before.pages == depot.pages) return;
  }
  files::write_file(settings, settings_of(depot).dump(1) + "\n");
}

Depot read_depot(const fs::path& folder, const std::string& version) {
  const fs::path settings = folder / "depot.json";
  if (!fs::is_regular_file(settings))
    throw BadInput(folder.string(), 1, "no depot.json, expected a folder that bms fleet run has written");
  Depot depot;
  depot.folder = folder;
  depot.version = version;
  try {
    const Json json = Json::parse(files::read_file(settings));
    depot.task = task_of(json.at("task").get<std::string>());
    depot.arguments = json.at("arguments").get<std::vector<std::string>>();
    const auto pages = json.at("pages").get<std::string>();
    depot.pages = pages == "none" ? Pages::none : Pages::all;
    if (pages == "found") depot.pages = Pages::found;
  } catch (const nlohmann::json::exception& error) {
    throw BadInput(settings.string(), 1, std::string("not valid (") + error.what() + "), expected a depot's settings");
  }
  return depot;
}

std::vector<std::string> arguments_of(const Depot& depot, const Unit& unit, const std::string& json,
                                      const std::string& page, const std::string& identified) {
  std::vector<std::string> a;
  switch (depot.task) {
    case Task::replay:
      a = {"replay", unit.recording, "--cell", unit.cell};
      break;
    case Task::identify:
      a = {"identify", "--start", unit.cell, "--recording", unit.recording, "--out", identified};
      break;
    case Task::diagnose:
      a = {"diagnose", "--cell", unit.cell, "--recording", unit.recording};
      break;
  }
  a.insert(a.end(), depot.arguments.begin(), depot.arguments.end());
  if (!json.empty()) a.insert(a.end(), {"--json", json});
  if (!page.empty()) a.insert(a.end(), {"--report", page});
  return a;
}

std::string command_of(const Depot& depot, const Unit& unit) {
  std::string command = "bms";
  for (const std::string& a : arguments_of(depot, unit, "", "", "identified.toml")) command += " " + shell_word(a);
  return command;
}

std::string cell_hash(const std::string& cell) {
  const auto& built_in = files::built_in_cells();
  const auto found =
      std::find_if(built_in.begin(), built_in.end(), [&](const files::BuiltInCell& c) { return c.name == cell; });
  if (found != built_in.end()) return files::sha256(found->text);
  try {
    return files::sha256(files::read_file(cell));
  } catch (const BadInput&) {
    return "";  // the task says what is wrong with it
  }
}

bool is_finished(const Depot& depot, const Unit& unit) {
  const fs::path path = depot.result(key_of(unit));
  std::error_code error;
  const auto written = fs::last_write_time(path, error);
  if (error) return false;
  const auto recorded = fs::last_write_time(unit.recording, error);
  if (!error && recorded > written) return false;
  const Json json = Json::parse(files::read_file(path), nullptr, false);
  if (!json.is_object() || (json.value("recording_sha256", "").empty() && fs::exists(unit.recording))) return false;
  return json.value("version", "") == depot.version && json.value("cell_sha256", "") == cell_hash(unit.cell) &&
         json.value("pages", "") == name_of(depot.pages);
}

}  // namespace bms::fleet
