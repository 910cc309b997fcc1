// Samples from CAN frames (hal/sample_frames.hpp): the measuring chain of a board that has none. Closing the channel
// ends them.
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/power_path.hpp"
#include "hal/sample_frames.hpp"
#include "hal/samples.hpp"
#include "hal/watchdog.hpp"

namespace bms::hal {

namespace {

SampleFrames<pack_cells> frames;
bool was_listening = false;

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  while (true) {
    can::Frame frame;
    while (can_receive(frame)) {
      was_listening = true;  // who closes the channel right after a sample, while it is being worked on, ends them, too
      if (dispatch_frame(frame) && frames.receive(frame))
        return &frames.sample();  // a frame that gets lost later is a missing reading, not the old one again
    }
    if (was_listening && !can_listening()) return nullptr;
    was_listening = can_listening();
    watchdog_feed();  // waiting for the other side is no fault of this one
    wait_for_interrupt();
  }
}

void power_path_set(const PowerPath&) {}  // who simulates the load hears it on the bus
std::int32_t dc_link_uv() { return frames.dc_link_uv(); }

}  // namespace bms::hal
