// What is in a log of CAN frames, by a DBC file: messages, their rates, ranges of the signals, and what these could be.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "files/read_options.hpp"

namespace bms::files {

struct ListedSignal {
  std::string name, unit;
  std::size_t values = 0, missing = 0;  ///< missing: "not available"
  double lowest = 0, highest = 0;       ///< of the values; 0 if all are missing
  std::string column;                   ///< of a recording that it could fill: "current_a"; empty: not known
};

struct ListedMessage {
  std::string name;
  std::uint32_t id = 0;
  bool long_id = false;
  std::string channel;
  std::size_t frames = 0;
  double first_s = 0, last_s = 0;
  std::vector<ListedSignal> signals;
  /// Mean time between frames; 0 for a single one.
  double cycle_s() const { return frames < 2 ? 0 : (last_s - first_s) / static_cast<double>(frames - 1); }
};

struct FrameList {
  std::vector<ListedMessage> messages;  ///< that the log has, by channel and identifier
  std::size_t unknown_frames = 0;       ///< that the DBC file does not describe
  std::size_t unknown_messages = 0;
};

/// Reads the log with options.dbc; without it, the battery's own messages. Throws BadInput if a file cannot be read, or
/// if the log has no frame that the DBC file describes.
FrameList list_frames(const std::string& path, const ReadOptions& options);

/// A line for each message and signal.
std::string text_of(const FrameList& list);

}  // namespace bms::files
