// A classic CAN bus: frames out, standard ones and those of 29 bits; standard ones in. Sending may wait for the line,
// receiving never does. Back ends: stm32f4/bxcan (a real bus), slcan/ (text over a UART), absent/ (nobody listens).
//
// can_receive() and can_listening() look after the bus beside: starting, errors, bus-off. Call one of them every 10 ms
// or so.
#pragma once

#include <cstdint>

#include "can/frame.hpp"

namespace bms::hal {

/// Never waits: the bus is up when can_health() says so.
void can_start();

/// Whether anybody would hear a frame: a bus that is up and acknowledges what is sent, an SLCAN channel that was
/// opened.
bool can_listening();

/// False when the frame could not be queued: it, or a less urgent one, is dropped.
bool can_send(const can::Frame& frame);

/// The next received frame, if there is one.
bool can_receive(can::Frame& frame);

/// Fault confinement of ISO 11898-1, by the error counters.
enum class CanState : std::uint8_t {
  absent = 0,    ///< no bus on this board
  starting = 1,  ///< not on the bus: it was not idle yet, the clock is not good enough, the SLCAN channel is closed
  active = 2,
  warning = 3,  ///< an error counter has reached 96
  passive = 4,  ///< 128
  bus_off = 5,  ///< transmit errors above 255
};

struct CanHealth {
  CanState state = CanState::absent;
  std::uint8_t transmit_errors = 0, receive_errors = 0;  ///< counters of ISO 11898-1
  // since boot; they wrap
  std::uint32_t sent = 0;      ///< frames that another node has acknowledged
  std::uint32_t received = 0;  ///< frames
  std::uint32_t dropped = 0;   ///< frames given to can_send() that did not get out
  std::uint32_t lost =
      0;  ///< frames (SLCAN: bytes) that came and found no place: nobody had called can_receive() in time
  std::uint32_t overruns = 0;  ///< times that the controller's own buffer was full, a frame or more each
  std::uint32_t bus_offs = 0;
  std::uint32_t failed_starts = 0;  ///< times that the bus did not become idle: a wire that is stuck, another bit rate
};
CanHealth can_health();

}  // namespace bms::hal
