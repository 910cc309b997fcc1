// Progress of long work, on standard error. On a terminal it is one line that is written again, from 2 s on. Elsewhere,
// as in a log of a build, it is a line every ten seconds. BMS_PROGRESS=off in the environment: nothing.
#pragma once

#include <functional>
#include <string>
#include <thread>

#include "workflow/progress.hpp"

namespace bms::tool {

/// every_s: least time between two lines on a terminal. line: text for the share done (0..1), the time left in s
/// (infinite at first) and the current part; empty: nothing is shown. Returns nothing if progress is off.
workflow::Progress progress_on_stderr(
    double every_s, std::function<std::string(double done, double left_s, const std::string& what)> line);

/// Removes the line of a terminal, so that something else can be printed.
void clear_progress();

/// What the heartbeat says next to the time from here on, of a command that knows its stages only.
void set_stage(const std::string& stage);

/// While it lives, shows the time that a command has taken if nothing else shows its progress.
class Heartbeat {
 public:
  /// what: "identify".
  explicit Heartbeat(std::string what);
  ~Heartbeat();
  Heartbeat(const Heartbeat&) = delete;
  Heartbeat& operator=(const Heartbeat&) = delete;

 private:
  std::jthread thread_;
};

}  // namespace bms::tool
