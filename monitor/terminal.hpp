// The terminal that the live screen is on: alternate screen, no cursor, keys as they are pressed. Given back as it was
// by the destructor, and when the program crashes or is stopped (Ctrl-Z). One at a time.
//
// Plain escape codes (ECMA-48, and xterm's 1049, 25 and 2026) rather than ncurses: a frame is a string that tests
// compare, it is written in one piece, and nothing depends on a terminal database.
#pragma once

#include <string>

#include "monitor/screen.hpp"

namespace bms::monitor {

class Terminal {
 public:
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  /// Of standard output, asked anew each time; where nobody knows, 80 x 24.
  static ScreenSize size();
  /// Whether it shows UTF-8, by the environment's locale (LC_ALL, LC_CTYPE, LANG).
  static bool shows_utf8();

  void show(const std::string& frame) const;
  /// Whether q was pressed.
  bool quit_pressed() const;
};

/// From its beginning on SIGINT, SIGTERM and SIGHUP ask the program to end, and SIGWINCH interrupts waiting.
class StopRequest {
 public:
  StopRequest();
  ~StopRequest();
  StopRequest(const StopRequest&) = delete;
  StopRequest& operator=(const StopRequest&) = delete;
  bool requested() const;
  /// Whether the terminal's size changed since the last call.
  bool resized();
};

}  // namespace bms::monitor
