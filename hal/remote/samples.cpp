// Samples that another node on the bus measures and sends (hal/sample_frames.hpp): for a board whose own measuring chain is not there yet.
//
// When none has come for 1.2 s, a sample without readings is given: the estimator is told that nothing is measured, goes on and loses
// certainty as it should, and the watchdog (2 s, at least 1.36 s by its oscillator) is fed by work, not by waiting. Its time goes on
// from the sender's last one.
#include <utility>

#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/request_queue.hpp"
#include "hal/requests.hpp"
#include "hal/sample_frames.hpp"
#include "hal/samples.hpp"

namespace bms::hal {

namespace {

constexpr std::uint64_t patience_us = 1'200'000;

Sample building, complete;
std::optional<StartingPoint> start;
RequestQueue requests;
std::uint64_t given_us = 0;

}  // namespace

bool next_request(CanFrame& frame) { return requests.next(frame); }

const Sample* next_sample() {
  while (true) {
    CanFrame frame;
    while (can_receive(frame)) {
      if (is_start(frame)) start = start_of(frame);
      if (!of_sample(frame)) requests.keep(frame);
      if (!completes(frame, building)) continue;
      complete = std::exchange(building, Sample{});  // a frame that gets lost later is a missing reading, not the old one again
      given_us = now_us();
      return &complete;
    }
    const std::uint64_t now = now_us(), waited = now - given_us;
    if (waited >= patience_us) {
      const std::uint64_t time_us = complete.time_us + waited;
      complete = Sample{};
      complete.time_us = time_us;
      given_us = now;
      return &complete;
    }
    wait_for_interrupt();
  }
}

std::optional<StartingPoint> starting_point() { return start; }

}  // namespace bms::hal
