// A classic CAN bus: standard frames out and in. Sending may wait for the line, receiving never does.
// Back ends: slcan/ (text over a UART), absent/ (nobody listens).
#pragma once

#include <array>
#include <cstdint>

namespace bms::hal {

struct CanFrame {
  std::uint16_t id = 0;                    ///< 11 bits
  std::uint8_t length = 0;                 ///< 0..8 bytes of data in use
  std::array<std::uint8_t, 8> data{};
};

void can_start();

/// Whether anybody would hear a frame: a bus that is up, an SLCAN channel that was opened.
bool can_listening();

/// False when the frame could not be queued; it is dropped.
bool can_send(const CanFrame& frame);

/// The next received frame, if there is one.
bool can_receive(CanFrame& frame);

}  // namespace bms::hal
