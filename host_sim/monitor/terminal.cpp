#include "monitor/terminal.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace bms::monitor {

namespace {

// Global, because a signal handler cannot be given an object.
termios before;
volatile sig_atomic_t entered = 0, stop_asked = 0, size_changed = 0;
bool input_is_terminal = false;
constexpr std::array crash_signals = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

void write_all(std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = write(STDOUT_FILENO, text.data(), text.size());
    if (n > 0) {
      text.remove_prefix(static_cast<std::size_t>(n));
    } else if (n < 0 && errno == EAGAIN) {
      pollfd p{STDOUT_FILENO, POLLOUT, 0};
      poll(&p, 1, 100);
    } else if (n < 0 && errno != EINTR) {
      return;
    }
  }
}

void enter() {
  if (input_is_terminal) {
    termios keys = before;
    keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);  // Ctrl-C stays a signal
    keys.c_cc[VMIN] = 0;
    keys.c_cc[VTIME] = 0;
    tcsetattr(STDIN_FILENO, TCSANOW, &keys);
  }
  write_all("\x1b[?1049h\x1b[?25l\x1b[2J");
  entered = 1;
}

/// Safe in a signal handler.
void leave() {
  if (entered == 0) return;
  entered = 0;
  write_all("\x1b[?2026l\x1b[0m\x1b[?25h\x1b[?1049l");
  if (input_is_terminal) tcsetattr(STDIN_FILENO, TCSANOW, &before);
}

void on_crash(int number) {
  leave();
  static_cast<void>(signal(number, SIG_DFL));
  static_cast<void>(raise(number));
}

void on_suspend(int) {
  const int errno_before = errno;
  leave();
  static_cast<void>(raise(SIGSTOP));  // the program continues here after SIGCONT
  enter();
  size_changed = 1;
  errno = errno_before;
}

void on_stop(int) { stop_asked = 1; }
void on_resize(int) { size_changed = 1; }

void handle(int number, void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;  // without SA_RESTART: poll returns
  sigemptyset(&action.sa_mask);
  sigaction(number, &action, nullptr);
}

}  // namespace

Terminal::Terminal() {
  input_is_terminal = isatty(STDIN_FILENO) != 0 && tcgetattr(STDIN_FILENO, &before) == 0;
  for (const int number : crash_signals) handle(number, on_crash);
  handle(SIGTSTP, on_suspend);
  enter();
}

Terminal::~Terminal() {
  leave();
  for (const int number : crash_signals) static_cast<void>(signal(number, SIG_DFL));
  static_cast<void>(signal(SIGTSTP, SIG_DFL));
}

ScreenSize Terminal::size() {
  winsize w{};
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &w) != 0 || w.ws_col == 0 || w.ws_row == 0) return {};
  return {w.ws_col, w.ws_row};
}

bool Terminal::shows_utf8() {
  for (const char* name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): this program does not set variables
    if (value == nullptr || *value == '\0') continue;
    const std::string_view text = value;
    return text.find("UTF-8") != text.npos || text.find("utf8") != text.npos || text.find("UTF8") != text.npos ||
           text.find("utf-8") != text.npos;
  }
  return false;
}

void Terminal::show(const std::string& frame) const { write_all(frame); }

bool Terminal::quit_pressed() const {
  if (!input_is_terminal) return false;
  char key = 0;
  while (true) {
    pollfd p{STDIN_FILENO, POLLIN, 0};
    if (poll(&p, 1, 0) <= 0 || read(STDIN_FILENO, &key, 1) != 1) return false;
    if (key == 'q' || key == 'Q') return true;
  }
}

StopRequest::StopRequest() {
  stop_asked = 0;
  size_changed = 0;
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) handle(number, on_stop);
  handle(SIGWINCH, on_resize);
  static_cast<void>(signal(SIGPIPE, SIG_IGN));
}

StopRequest::~StopRequest() {
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGWINCH, SIGPIPE}) static_cast<void>(signal(number, SIG_DFL));
}

bool StopRequest::requested() const { return stop_asked != 0; }

bool StopRequest::resized() {
  const bool changed = size_changed != 0;
  size_changed = 0;
  return changed;
}

}  // namespace bms::monitor
