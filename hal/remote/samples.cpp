// Samples that another node on the bus measures and sends (hal/sample_frames.hpp), for a board without a measuring
// chain of its own. The load and its contactors are also on the bus.
//
// If no sample arrives for five sample periods (at most 1.2 s), this back end returns a sample without readings, and
// one more per period from that moment. Estimator and protection then know that nothing is measured, and the watchdog
// (2 s, at least 1.36 s by its oscillator) is fed by work instead of waiting. The time continues from the sender's last
// time. If a sender's time falls back by more than the timeout, the sender has restarted; its time continues as well.
#include "hal/samples.hpp"
#include "hal/accepted_frames.hpp"
#include "hal/can.hpp"
#include "hal/charger_bus.hpp"
#include "hal/clock.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/group_bus.hpp"
#include "hal/power_path.hpp"
#include "hal/sample_frames.hpp"
#include "hal/update_frames.hpp"

namespace bms::hal {

namespace {

constexpr auto period_us = static_cast<std::uint64_t>(1e6 * sample_period_s);
constexpr std::uint64_t max_wait_us = 1'200'000, timeout_us = 5 * period_us < max_wait_us ? 5 * period_us : max_wait_us,
                        repeat_us = period_us < max_wait_us ? period_us : max_wait_us;

SampleFrames<pack_cells> frames;
measurement::PackSample<pack_cells> no_readings, given;
std::uint64_t given_us = 0, last_us = 0, offset_us = 0;  // offset_us: own time at the sender's zero
bool silent = false;                                     ///< the last sample had no readings

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  while (true) {
    charger_bus_service();
    group_bus_service();
    can::Frame frame;
    while (can_receive(frame)) {
      if (!dispatch_frame(frame) || !frames.receive(frame))
        continue;  // a lost frame makes a reading missing, it does not repeat the old one
      given = frames.sample();
      given.time_us += offset_us;
      if (given.time_us + timeout_us < last_us) {
        const std::uint64_t gap_us = last_us + (now_us() - given_us) - given.time_us;
        offset_us += gap_us;
        given.time_us += gap_us;
      }
      given_us = now_us();
      silent = false;
      last_us = given.time_us;
      return &given;
    }
    const std::uint64_t now = now_us(), waited = now - given_us;
    if (waited >= (silent ? repeat_us : timeout_us)) {
      no_readings.time_us = last_us += waited;
      given_us = now;
      silent = true;
      return &no_readings;
    }
    wait_for_interrupt();
  }
}

std::uint32_t acquisition_us() { return 0; }
std::optional<measurement::StartingPoint> starting_point() { return frames.starting_point(); }
std::span<const std::uint16_t> accepted_ids() {
  static constexpr auto ids = with_updates(request_and_sample_ids);
  return ids;
}
void power_path_set(const PowerPath&) {}
LinkVoltages link_voltages() { return {frames.link_plus_uv(), frames.link_minus_uv()}; }

}  // namespace bms::hal
