// Samples from CAN frames (hal/sample_frames.hpp), for a board without a measuring chain. They end when the host closes
// the channel.
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
      was_listening = true;  // the host may close the channel right after a sample, while it is being processed
      if (dispatch_frame(frame) && frames.receive(frame))
        return &frames.sample();  // a lost frame makes a reading missing, it does not repeat the old one
    }
    if (was_listening && !can_listening()) return nullptr;
    was_listening = can_listening();
    watchdog_feed();  // waiting for the host is normal here
    wait_for_interrupt();
  }
}

std::uint32_t acquisition_us() { return 0; }
std::optional<measurement::StartingPoint> starting_point() { return frames.starting_point(); }
void power_path_set(const PowerPath&) {}  // the simulated load receives it as a CAN frame
LinkVoltages link_voltages() { return {frames.link_plus_uv(), frames.link_minus_uv()}; }

}  // namespace bms::hal
