// CAN frames for the firmware itself: all received frames that are not part of a sample. Back ends: frame_dispatch
// (frames that arrive between the samples), absent/ (no requests).
#pragma once

#include "hal/can.hpp"

namespace bms::hal {

/// Returns true and the oldest waiting frame, or false if none waits. While eight wait, new frames are dropped.
bool next_request(can::Frame& frame);

}  // namespace bms::hal
