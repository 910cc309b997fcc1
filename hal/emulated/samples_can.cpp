// Samples from CAN frames (hal/sample_frames.hpp): the measuring chain of a board that has none. Closing the channel ends them.
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/request_queue.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/samples.hpp"
#include "hal/watchdog.hpp"

#include <utility>

namespace bms::hal {

namespace {

Sample building, complete;
std::optional<StartingPoint> start;
bool was_listening = false;
RequestQueue requests;

}  // namespace

bool next_request(CanFrame& frame) { return requests.next(frame); }

const Sample* next_sample() {
  while (true) {
    CanFrame frame;
    while (can_receive(frame)) {
      if (is_start(frame)) start = start_of(frame);
      if (completes(frame, building)) {
        complete = std::exchange(building, Sample{});  // a frame that gets lost later is a missing reading, not the old one again
        return &complete;
      }
      if (!of_sample(frame)) requests.keep(frame);
    }
    if (was_listening && !can_listening()) return nullptr;
    was_listening = can_listening();
    watchdog_feed();  // waiting for the other side is no fault of this one
    wait_for_interrupt();
  }
}

std::optional<StartingPoint> starting_point() { return start; }

}  // namespace bms::hal
