// The battery's own CAN frames (firmware/can/greybox_bms.dbc), which need no DBC file and no mapping.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "files/logs/dbc.hpp"
#include "files/logs/frame_text.hpp"

namespace bms::files {

/// The text of firmware/can/greybox_bms.dbc.
extern const std::string_view own_dbc;
inline constexpr const char* own_dbc_name = "the battery's own messages";

/// Its signals.
const std::vector<DbcSignal>& own_signals();

/// Returns true if the frame has an identifier of 11 bits, eight bytes, and the check code that the battery's own
/// message of this identifier has.
bool is_own_frame(const TextFrame& frame);
/// Returns true for the last message of a sample of the battery.
bool ends_a_sample(const TextFrame& frame);

/// Columns of a recording and the signals of the battery's own frames in a log that fill them, as lines of --map:
/// current, temperatures, and of a pack the voltage of each cell that was read at least once. Empty if the log has no
/// Identity frame. format: of the log, empty if unknown. channel: the only one that is read; empty: all. Throws
/// BadInput if the file cannot be read.
std::vector<std::string> own_map_of(const std::string& path, const std::string& format, const std::string& channel);

}  // namespace bms::files
