// The output of the monitor for other programs: one JSON object, and rows of CSV.
#pragma once

#include <string>

#include "monitor/bus_state.hpp"
#include "monitor/screen.hpp"

namespace bms::monitor {

/// One JSON object: the battery, each message with its signals, and the errors of the bus. It depends only on the
/// frames, except for `source` and `silent_s`, the time since the last frame.
std::string json_of(const BusState& bus, const ScreenFacts& facts, double silent_s = 0);

/// The columns time_s (since the first frame), current_a, voltage_v and temperature_c of a recording, then each signal
/// of the DBC files as "Message.Signal [unit]".
std::string csv_head();
/// One row of last values; a field is empty if the value is invalid, never received or stale.
std::string csv_row(const BusState& bus);

}  // namespace bms::monitor
