// Frames for the firmware itself: what came over CAN and is no sample.
// Back ends: heard (they arrive between the samples), absent/ (nobody asks).
#pragma once

#include "hal/can.hpp"

namespace bms::hal {

/// The next one, if there is; in the order they came. A few are kept; of more, the oldest.
bool next_request(can::Frame& frame);

}  // namespace bms::hal
