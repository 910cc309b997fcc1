// Sorts the received CAN frames for a back end of samples.hpp: parts of samples are the back end's, or ignored if the
// board measures itself; requests are stored until next_request() (requests.hpp) fetches them.
#pragma once

#include "hal/can.hpp"

namespace bms::hal {

/// Returns true if the frame is part of a sample or a starting point (sample_frames.hpp). Queues any other frame.
bool dispatch_frame(const can::Frame& frame);

}  // namespace bms::hal
