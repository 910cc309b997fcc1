// CAN frames for the firmware itself: all received frames that are not part of a sample. Back ends: frame_dispatch
// (frames that arrive between the samples), absent/ (no requests).
#pragma once

#include "hal/can.hpp"

namespace bms::hal {

/// Returns true and the next frame of the battery's own messages, or false if none waits. All of them have the right
/// length and CRC. Order and places: hal/request_queue.hpp.
bool next_request(can::Frame& frame);

/// The same for frames of other protocols on this bus (CANopen), which have a queue of their own.
bool next_network_frame(can::Frame& frame);

}  // namespace bms::hal
