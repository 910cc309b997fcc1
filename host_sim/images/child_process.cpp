#include "images/child_process.hpp"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <stdexcept>
#include <system_error>

#include "files/temporary_folder.hpp"
#include "files/text_file.hpp"

extern char** environ;

namespace bms::images {

namespace {

int exit_status(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

}  // namespace

ChildProcess::ChildProcess(const std::vector<std::string>& argv, const std::filesystem::path& log) {
  std::vector<char*> pointers;
  for (const std::string& argument : argv) pointers.push_back(const_cast<char*>(argument.c_str()));
  pointers.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  const int error = posix_spawnp(&pid_, pointers[0], &actions, nullptr, pointers.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw std::runtime_error(argv[0] + " cannot be started: " + std::generic_category().message(error));
}

ChildProcess::~ChildProcess() {
  if (!running()) return;
  kill(pid_, SIGKILL);
  wait();
}

bool ChildProcess::running() {
  if (ended_) return false;
  const pid_t changed = waitpid(pid_, &status_, WNOHANG);
  ended_ = changed == pid_ || (changed < 0 && errno != EINTR);
  return !ended_;
}

int ChildProcess::wait() {
  while (!ended_) ended_ = waitpid(pid_, &status_, 0) == pid_ || errno != EINTR;
  return exit_status(status_);
}

std::string output_of(const std::vector<std::string>& argv) {
  const files::TemporaryFolder folder;
  const auto log = folder.path() / "log";
  const int status = ChildProcess(argv, log).wait();
  std::string text = files::read_file(log);
  if (status != 0) throw std::runtime_error(argv[0] + " failed: " + text);
  return text;
}

bool in_path(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::string folders = path == nullptr ? "" : path;
  while (!folders.empty()) {
    const std::size_t end = folders.find(':');
    if (access((folders.substr(0, end) + "/" + program).c_str(), X_OK) == 0) return true;
    folders = end == std::string::npos ? "" : folders.substr(end + 1);
  }
  return false;
}

}  // namespace bms::images
