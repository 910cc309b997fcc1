// A board on the other end of a CAN bus, in lock step: frames in, and what it answers to them.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "hal/can.hpp"

namespace bms::hil {

class BoardLink {
 public:
  virtual ~BoardLink() = default;
  /// Sends, and returns all that the board says until it has nothing more to do. time_s: what the board's clock shows
  /// then, if it follows. Throws std::runtime_error when it has stopped.
  virtual std::vector<can::Frame> exchange(double time_s, std::span<const can::Frame> frames) = 0;
};

/// Firmware in the emulator (an image whose bus is hal/emulated/can_pipe). `command`: the emulator's, its program's
/// arguments left open.
std::unique_ptr<BoardLink> emulated_link(const std::string& board, const std::filesystem::path& image);

/// A board on a serial port that speaks SLCAN. It is not in lock step: its answer ends with its status message, or
/// after a second.
std::unique_ptr<BoardLink> serial_link(const std::string& port);

}  // namespace bms::hil
