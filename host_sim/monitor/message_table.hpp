// The messages of the bus as lines of the screen: one per message, one per signal, and the unknown ids.
#pragma once

#include <vector>

#include "monitor/bus_state.hpp"
#include "monitor/screen_line.hpp"

namespace bms::monitor {

/// A heading, then a line for each message of which any frame was received.
std::vector<ScreenLine> message_table(const BusState& bus);

/// The same, with each signal below its message.
std::vector<ScreenLine> signal_table(const BusState& bus);

/// One line of at most `columns` columns with the ids that are not in the DBC files; no line without such ids.
std::vector<ScreenLine> unknown_id_lines(const BusState& bus, std::size_t columns);

}  // namespace bms::monitor
