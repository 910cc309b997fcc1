// Sorts the received CAN frames for a back end of samples.hpp: parts of samples go to the back end; the starting point
// and requests are stored until starting_point() and next_request() (requests.hpp) fetch them.
#pragma once

#include "hal/can.hpp"

namespace bms::hal {

/// Returns true if the frame is part of a sample or a starting point (sample_frames.hpp). Queues any other frame.
bool dispatch_frame(const can::Frame& frame);

}  // namespace bms::hal
