// Samples that another node on the bus measures and sends (hal/sample_frames.hpp), for a board whose own measuring
// chain is not there yet. The load and its contactors are on the bus, too.
//
// When none has come for five sample periods, 1.2 s at most, one without readings is given, and one each period from
// then on: estimator and protection are told that nothing is measured, go on and lose certainty as they should, and the
// watchdog (2 s, at least 1.36 s by its oscillator) is fed by work, not by waiting. Its time goes on from the sender's
// last one. A sender whose time falls back by more than that patience has begun anew: its time is taken to go on, too.
#include "hal/samples.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/power_path.hpp"
#include "hal/sample_frames.hpp"

namespace bms::hal {

namespace {

constexpr auto period_us = static_cast<std::uint64_t>(1e6 * sample_period_s);
constexpr std::uint64_t longest_us = 1'200'000, patience_us = 5 * period_us < longest_us ? 5 * period_us : longest_us,
                        again_us = period_us < longest_us ? period_us : longest_us;

SampleFrames<pack_cells> frames;
measurement::PackSample<pack_cells> nothing, given;
std::uint64_t given_us = 0, last_us = 0, before_us = 0;  // before_us: what came before the sender's own zero
bool silent = false;                                     ///< the last one given was without readings

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  while (true) {
    can::Frame frame;
    while (can_receive(frame)) {
      if (!dispatch_frame(frame) || !frames.receive(frame))
        continue;  // a frame that gets lost later is a missing reading, not the old one again
      given = frames.sample();
      given.time_us += before_us;
      if (given.time_us + patience_us < last_us) {
        const std::uint64_t goes_on_us = last_us + (now_us() - given_us) - given.time_us;
        before_us += goes_on_us;
        given.time_us += goes_on_us;
      }
      given_us = now_us();
      silent = false;
      last_us = given.time_us;
      return &given;
    }
    const std::uint64_t now = now_us(), waited = now - given_us;
    if (waited >= (silent ? again_us : patience_us)) {
      nothing.time_us = last_us += waited;
      given_us = now;
      silent = true;
      return &nothing;
    }
    wait_for_interrupt();
  }
}

void power_path_set(const PowerPath&) {}
std::int32_t dc_link_uv() { return frames.dc_link_uv(); }

}  // namespace bms::hal
