// Runs the built tool as a user does: arguments in; exit code, standard output and standard error out. And what the
// tests of the tool share.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include "files/temporary_folder.hpp"
#include "images/child_process.hpp"  // for the tests that start the tool themselves

namespace bms {

struct ToolRun {
  int exit_code = -1;
  std::string out, err;
};

inline std::string content(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The forklift shift of this repository: eight hours at 1 Hz.
inline const std::string shift = BMS_SOURCE_DIR "/evidence/recordings/forklift_shift.csv";
/// Real recordings, which are not part of the repository; tests that need them skip if they are missing.
inline const std::filesystem::path data = BMS_DATA_DIR;

/// A slow machine must not add lines of progress to what is compared.
inline const int progress_is_off = setenv("BMS_PROGRESS", "off", 0);

/// arguments: as typed in a shell.
inline ToolRun run_tool(const std::string& arguments) {
  const files::TemporaryFolder folder;
  const std::string out = (folder.path() / "stdout").string(), err = (folder.path() / "stderr").string();
  const int status = std::system(("\"" BMS_TOOL "\" " + arguments + " >" + out + " 2>" + err).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128, content(out), content(err)};
}

/// JSON without the fields that differ from run to run.
inline std::string reproducible(const std::string& json) {
  return std::regex_replace(json, std::regex("\"(wall_s|[a-z_]*_per_second)\": [-0-9.e+]+"), "");
}

}  // namespace bms
