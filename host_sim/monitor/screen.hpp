// The state of the bus as lines of text for a terminal of any size.
//
// The most important lines come first, and lines that do not fit are left out. The order is: state of charge with its
// two-sigma band, pack, faults, contactor, flags, limits, health, cells, then the messages with their rates, ages and
// errors, and on a large terminal each signal. From 150 columns on, the messages are to the right of the pack. Stale
// values are faint.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "monitor/bus_state.hpp"
#include "monitor/frame_source.hpp"
#include "monitor/screen_line.hpp"

namespace bms::monitor {

struct ScreenSize {
  std::size_t columns = 80, rows = 24;
};

/// What the screen shows in addition to the state of the bus.
struct ScreenFacts {
  std::string source;
  std::uint64_t malformed = 0, dropped = 0;
  double frames_per_second = 0;
  bool blocks = true;  ///< the terminal shows UTF-8; otherwise ASCII
};

/// At most size.rows lines of at most size.columns columns.
std::vector<ScreenLine> screen(const BusState& bus, const ScreenFacts& facts, const ScreenSize& size);

/// One line without styles, for logs and for standard output that is not a terminal.
std::string status_line(const BusState& bus, const ScreenFacts& facts);

}  // namespace bms::monitor
