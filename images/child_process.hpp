// Programs run by the tool: started without a shell, ended with it.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace bms::images {

/// A running program. Killed by the destructor if it has not ended.
class ChildProcess {
 public:
  /// argv[0] is looked up in PATH. Output goes to `log` (both streams), input is empty. Throws std::runtime_error.
  ChildProcess(const std::vector<std::string>& argv, const std::filesystem::path& log);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  bool running();
  /// Waits for the end; exit status, or 128 + signal.
  int wait();

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

/// Runs a program to its end; what it printed on both streams. Throws std::runtime_error, with that, when it fails.
std::string output_of(const std::vector<std::string>& argv);

bool in_path(const std::string& program);

/// A folder of its own for temporary files, removed with its content.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace bms::images
