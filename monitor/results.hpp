// What the monitor hands to programs: one JSON object, and rows of CSV.
#pragma once

#include <string>

#include "monitor/bus_state.hpp"
#include "monitor/screen.hpp"

namespace bms::monitor {

/// One JSON object: the battery, each message with its signals, what was wrong. From the frames alone, so that a record
/// gives the same, but for `source` and `silent_s` (how long ago the last frame came).
std::string json_of(const BusState& bus, const ScreenFacts& facts, double silent_s = 0);

/// time_s (since the first frame), current_a, voltage_v, temperature_c as in a recording, then every signal of the DBC
/// file as "Message.Signal [unit]".
std::string csv_head();
/// One row: the last values as they stand; empty where not known, never said or stale.
std::string csv_row(const BusState& bus);

}  // namespace bms::monitor
