// Runs the built tool as a user does: arguments in; exit code, standard output and standard error out.
#pragma once

#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "images/child_process.hpp"

namespace bms {

struct ToolRun {
  int exit_code = -1;
  std::string out, err;
};

inline std::string content(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// arguments: as typed in a shell.
inline ToolRun run_tool(const std::string& arguments) {
  const images::TemporaryFolder folder;
  const std::string out = (folder.path() / "stdout").string(), err = (folder.path() / "stderr").string();
  const int status = std::system(("\"" BMS_TOOL "\" " + arguments + " >" + out + " 2>" + err).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : 128, content(out), content(err)};
}

}  // namespace bms
