// Programs that the tool runs: started without a shell, killed when the tool ends.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace bms::images {

/// A running program. The destructor kills it if it is still running.
class ChildProcess {
 public:
  /// argv[0] is searched in PATH. Both output streams go to `log`; the input is empty. Throws std::runtime_error if the
  /// program cannot be started.
  ChildProcess(const std::vector<std::string>& argv, const std::filesystem::path& log);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }
  bool running();
  /// Waits for the end. Returns the exit status, or 128 + signal.
  int wait();

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

/// Runs a program to its end. Returns the text of both output streams. Throws std::runtime_error, with that text, if
/// the exit status is not 0.
std::string output_of(const std::vector<std::string>& argv);

/// Returns true if an executable of that name is in PATH.
bool in_path(const std::string& program);

}  // namespace bms::images
