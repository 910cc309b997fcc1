#include "tool/progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <mutex>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace bms::tool {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double silent_s = 2, every_without_terminal_s = 10;

bool off() {
  const char* setting = std::getenv("BMS_PROGRESS");
  return setting != nullptr && std::string_view(setting) == "off";
}

/// Without the blanks that overwrite a longer line of a terminal.
std::string trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(' '), last = text.find_last_not_of(' ');
  return first == std::string::npos ? "" : text.substr(first, last - first + 1);
}

/// What stands on the line of the terminal. Commands and the heartbeat write from threads of their own.
class Line {
 public:
  explicit Line(bool terminal) : terminal_(terminal) {}

  void show(const std::string& text) {
    const std::lock_guard lock(mutex_);
    last_ = Clock::now();
    if (terminal_) {
      std::fprintf(stderr, "\r%s%*s", text.c_str(), static_cast<int>(width_ > text.size() ? width_ - text.size() : 0),
                   "");
      width_ = text.size();
    } else {
      std::fprintf(stderr, "%s%s\n", command_.empty() ? "" : (command_ + ": ").c_str(), trimmed(text).c_str());
    }
    std::fflush(stderr);
  }
  void clear() {
    const std::lock_guard lock(mutex_);
    if (width_ == 0) return;
    std::fprintf(stderr, "\r%*s\r", static_cast<int>(width_), "");
    std::fflush(stderr);
    width_ = 0;
  }
  double since_last_s() {
    const std::lock_guard lock(mutex_);
    return std::chrono::duration<double>(Clock::now() - last_).count();
  }
  bool terminal() const { return terminal_; }
  /// The command that the lines of a log begin with.
  void set_command(const std::string& command) {
    const std::lock_guard lock(mutex_);
    command_ = command;
  }
  std::string latest() {
    const std::lock_guard lock(mutex_);
    return latest_;
  }
  void set_latest(const std::string& text) {
    const std::lock_guard lock(mutex_);
    latest_ = trimmed(text);
  }

 private:
  const bool terminal_;
  std::mutex mutex_;
  std::string command_, latest_;  ///< latest_: the share and the stage, if a command reports them
  std::size_t width_ = 0;
  Clock::time_point last_ = Clock::now();
};

Line& line_of_progress() {
  static Line line(isatty(STDERR_FILENO) != 0);
  return line;
}

}  // namespace

void clear_progress() { line_of_progress().clear(); }

void set_stage(const std::string& stage) { line_of_progress().set_latest(stage); }

workflow::Progress progress_on_stderr(
    double every_s, std::function<std::string(double done, double left_s, const std::string& what)> text_of) {
  if (off()) return {};
  Line& line = line_of_progress();
  const double pause_s = line.terminal() ? every_s : every_without_terminal_s;
  const auto begin = Clock::now();
  return [begin, pause_s, text_of = std::move(text_of), &line,
          shown_s = std::make_shared<double>(line.terminal() ? -every_s : 0)](double done, const std::string& what) {
    const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
    if (done >= 1) return line.clear();
    const double left_s = done > 0 ? seconds / done * (1 - done) : std::numeric_limits<double>::infinity();
    const std::string text = text_of(done, left_s, what);
    if (text.empty()) return;
    line.set_latest(text);  // also for the next line of the heartbeat
    if (seconds - *shown_s < pause_s) return;
    *shown_s = seconds;
    line.show(text);
  };
}

Heartbeat::Heartbeat(std::string what) {
  if (off()) return;
  Line& line = line_of_progress();
  line.set_command(line.terminal() ? "" : what);
  thread_ = std::jthread([&line, what = std::move(what)](const std::stop_token& stop) {
    const auto begin = Clock::now();
    const double pause_s = line.terminal() ? silent_s : every_without_terminal_s;
    std::mutex mutex;
    std::condition_variable_any stopped;
    std::unique_lock lock(mutex);
    while (!stopped.wait_for(lock, stop, std::chrono::seconds(1), [&] { return stop.stop_requested(); })) {
      if (line.since_last_s() < pause_s) continue;
      const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
      const std::string latest = line.latest();
      const std::string name = line.terminal() ? what + ": " : "";
      line.show(fmt::format("{}{:.0f} s{}{}", name, seconds, latest.empty() ? "" : ", ", latest));
    }
  });
}

Heartbeat::~Heartbeat() {
  if (!thread_.joinable()) return;
  thread_.request_stop();
  thread_.join();
  clear_progress();
}

}  // namespace bms::tool
