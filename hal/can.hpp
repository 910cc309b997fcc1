// A classic CAN bus: sends and receives standard frames and 29-bit frames. Sending may wait for the line,
// receiving never does. Back ends: stm32f4/bxcan (a real bus), slcan/ (text over a UART), absent/ (no bus).
//
// can_receive() and can_listening() also handle start, errors and bus-off. Call one of them about every 10 ms.
#pragma once

#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: bit rate and identifiers
#include "can/frame.hpp"
#include "hal/identifiers.hpp"

namespace bms::hal {

inline constexpr CanSettings can_settings_of_build{can_bit_rate, can_base, can_stop};

/// Returns at once. can_health() shows when the node is on the bus. Other back ends than a real bus ignore the
/// settings.
void can_start(const CanSettings& settings = can_settings_of_build);

/// Returns true if another node would receive a frame: the bus is up and acknowledges, or the SLCAN channel is open.
bool can_listening();

/// Returns false if the queue was full and this frame or a less urgent one was dropped.
bool can_send(const can::Frame& frame);

/// Returns true and the next received frame, or false if no frame waits.
bool can_receive(can::Frame& frame);

/// Fault confinement state of ISO 11898-1, from the error counters.
enum class CanState : std::uint8_t {
  absent = 0,    ///< no bus on this board
  starting = 1,  ///< not on the bus: no idle bus yet, crystal failed, or SLCAN channel closed
  active = 2,
  warning = 3,  ///< an error counter is 96 or more
  passive = 4,  ///< an error counter is 128 or more
  bus_off = 5,  ///< transmit errors above 255
};

struct CanHealth {
  CanState state = CanState::absent;
  std::uint8_t transmit_errors = 0, receive_errors = 0;  ///< counters of ISO 11898-1
  // Counters since boot; they wrap.
  std::uint32_t sent = 0;      ///< frames that another node acknowledged
  std::uint32_t received = 0;  ///< frames
  std::uint32_t dropped = 0;   ///< frames given to can_send() that were not sent
  std::uint32_t lost = 0;      ///< received frames (SLCAN: bytes) lost because can_receive() was called too rarely
  std::uint32_t overruns = 0;  ///< times that the controller's FIFO was full; each lost one frame or more
  std::uint32_t bus_offs = 0;
  std::uint32_t failed_starts = 0;  ///< times that the bus did not become idle: stuck wire, or another bit rate
};
CanHealth can_health();

}  // namespace bms::hal
