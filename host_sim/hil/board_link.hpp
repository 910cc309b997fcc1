// The connection to a board on a CAN bus.
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
  /// Sends `frames` and returns the frames that the board sends in response. `time_s` sets the clock of an emulated
  /// board. Throws std::runtime_error if the board has stopped.
  virtual std::vector<can::Frame> exchange(double time_s, std::span<const can::Frame> frames) = 0;
};

/// Runs `image` in the emulator of `board`, in lock step: exchange() returns when the firmware waits for input again.
/// The CAN bus of the image is hal/emulated/can_pipe.
std::unique_ptr<BoardLink> emulated_link(const std::string& board, const std::filesystem::path& image);

/// A board that speaks SLCAN on a serial port. It does not run in lock step: exchange() returns after the Status
/// message that answers a sample, or after one second. Throws files::BadInput if the port cannot be opened.
std::unique_ptr<BoardLink> serial_link(const std::string& port);

}  // namespace bms::hil
