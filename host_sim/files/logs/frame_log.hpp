// Recordings from logs of CAN frames: a DBC file describes the frames, the user names the signals. The battery's own
// frames (firmware/can/greybox_bms.dbc) need neither.
#pragma once

#include <optional>
#include <string>

#include "files/read_options.hpp"
#include "measurement/recording.hpp"

namespace bms::files {

/// Name of the format if the file begins like a log of CAN frames (host_sim/files/logs/frame_text.hpp), or if the
/// options name one. Throws BadInput if the file cannot be read.
std::optional<std::string> frame_format_of(const std::string& path, const ReadOptions& options);

/// Each frame with the current makes a row: its time, its current, and the last value of every other signal. A value
/// that means "not available" (host_sim/files/logs/dbc.hpp) is missing. Without a DBC file the log must be one of the
/// battery's own: a row is then a sample whose voltages were sent, with the mean current since the row before. bytes:
/// gets the size of the text. Throws BadInput if nothing describes the frames, a signal is unknown, or its frames are
/// missing.
measurement::Recording read_frame_log(const std::string& path, const ReadOptions& options, std::size_t& bytes);

/// The lines "NAME=VALUE" of a mapping file; comments begin with '#'. Throws BadInput.
std::vector<std::string> read_map_file(const std::string& path);

}  // namespace bms::files
