// A program that is run for one unit. Its output is kept in memory that belongs to this process, so that nothing is
// left behind whenever either of them is killed.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

namespace bms::fleet {

class Process {
 public:
  /// Starts the program argv[0]. It is killed when this process ends, and does not get the Ctrl-C of the terminal.
  /// Throws std::system_error.
  explicit Process(const std::vector<std::string>& argv);
  ~Process();
  Process(Process&& other) noexcept;
  Process& operator=(Process&&) = delete;

  pid_t pid() const { return pid_; }
  /// What it has printed until now.
  std::string standard_output() const;
  std::string standard_error() const;
  /// It has ended and was waited for: the destructor does not kill it.
  void ended() { pid_ = -1; }

 private:
  pid_t pid_ = -1;
  int out_ = -1, err_ = -1;
};

}  // namespace bms::fleet
