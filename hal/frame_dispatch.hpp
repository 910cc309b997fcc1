// What the bus brings to a back end of samples.hpp: parts of samples, which it makes of them what it will; the starting
// point and requests for the firmware, which are kept here until starting_point() and next_request() (requests.hpp) ask
// for them.
#pragma once

#include "hal/can.hpp"

namespace bms::hal {

/// Whether the frame is part of a sample (sample_frames.hpp); anything else has been kept.
bool dispatch_frame(const can::Frame& frame);

}  // namespace bms::hal
