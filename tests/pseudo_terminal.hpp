// A pseudo-terminal whose other side is the tool.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <pty.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <string>
#include <thread>

namespace bms::tests {

/// Opens both sides. Skips the test on a machine without /dev/pts, such as a bare chroot: as a member of a fixture this
/// keeps the test from running.
inline void open_pseudo_terminal(int& master, int& slave, char* name, const winsize* size) {
  if (openpty(&master, &slave, name, nullptr, size) != 0) GTEST_SKIP() << "this machine has no pseudo-terminals";
}

/// A terminal of a given size for the tool's standard output, or the line to an adapter. For members of fixtures.
class PseudoTerminal {
 public:
  explicit PseudoTerminal(unsigned short columns = 80, unsigned short rows = 24) {
    const winsize size{rows, columns, 0, 0};
    open_pseudo_terminal(master_, slave_, name_, &size);
    fcntl(master_, F_SETFD, FD_CLOEXEC);
    fcntl(slave_, F_SETFD, FD_CLOEXEC);
    fcntl(master_, F_SETFL, O_NONBLOCK);
  }
  ~PseudoTerminal() {
    close(master_);
    close(slave_);
  }
  const char* name() const { return name_; }
  int slave() const { return slave_; }

  void write(const std::string& text) const {
    for (std::size_t at = 0; at < text.size();) {
      const ssize_t n = ::write(master_, text.data() + at, text.size() - at);
      if (n > 0)
        at += static_cast<std::size_t>(n);
      else
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  /// What the other side has written since the last call; does not wait.
  std::string read() const {
    char bytes[4096];
    const ssize_t n = ::read(master_, bytes, sizeof bytes);
    return n > 0 ? std::string(bytes, static_cast<std::size_t>(n)) : std::string();
  }
  /// Reads the line until `what` appears, for at most two minutes: a limit for a failure, not for a slow machine.
  std::string read_until(
      const std::string& what, std::function<void()> meanwhile = [] {}) const {
    std::string text;
    for (int tries = 0; tries < 12'000 && text.find(what) == std::string::npos; ++tries) {
      meanwhile();
      pollfd p{master_, POLLIN, 0};
      if (poll(&p, 1, 10) > 0) text += read();
    }
    return text;
  }
  void resize(unsigned short columns, unsigned short rows) const {
    const winsize size{rows, columns, 0, 0};
    ioctl(master_, TIOCSWINSZ, &size);
  }
  termios settings() const {
    termios now{};
    tcgetattr(slave_, &now);
    return now;
  }

 private:
  int master_ = -1, slave_ = -1;
  char name_[64] = {};
};

}  // namespace bms::tests
