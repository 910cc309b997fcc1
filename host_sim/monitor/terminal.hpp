// The terminal of the live screen: alternate screen, no cursor, unbuffered keys. The destructor restores it; it is also
// restored when the program crashes or is stopped (Ctrl-Z). Only one object at a time.
//
// It uses plain escape codes (ECMA-48, and xterm's 1049, 25 and 2026) instead of ncurses: a frame is a string that
// tests compare, it is written at once, and no terminal database is needed.
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

  /// The current size of standard output; 80 x 24 if unknown.
  static ScreenSize size();
  /// Returns true if the locale of the environment (LC_ALL, LC_CTYPE, LANG) is UTF-8.
  static bool shows_utf8();

  void show(const std::string& frame) const;
  /// Returns true if q was pressed since the last call.
  bool quit_pressed() const;
};

/// While it exists, SIGINT, SIGTERM and SIGHUP request the end of the program, and SIGWINCH interrupts waiting.
class StopRequest {
 public:
  StopRequest();
  ~StopRequest();
  StopRequest(const StopRequest&) = delete;
  StopRequest& operator=(const StopRequest&) = delete;
  bool requested() const;
  /// Returns true if the size of the terminal changed since the last call.
  bool resized();
};

}  // namespace bms::monitor
