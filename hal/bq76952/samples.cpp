// Samples that the board measures itself, one per period of its own clock. Between samples it receives CAN frames:
// requests and the starting point. If the front end does not answer, the sample has no readings, so estimator and
// protection know that nothing is measured.
//
// If the core was stopped (an erase of flash) and a sample is late, the next period starts at this sample; the
// following samples are not early.
#include "hal/samples.hpp"
#include "hal/bq76952/front_end.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/i2c.hpp"
#include "hal/power_path.hpp"

namespace bms::hal {

namespace {

static_assert(pack_cells == bq76952::cell_inputs);
constexpr auto period_us = static_cast<std::uint64_t>(1e6 * sample_period_s);

constexpr auto settings = bq76952::settings(bq76952::Board{});
bq76952::FrontEnd front_end{settings};
measurement::PackSample<pack_cells> sample;
std::uint64_t due_us = 0;
bool started = false;

void receive_frames() {
  can::Frame frame;
  while (can_receive(frame)) dispatch_frame(frame);
}

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  if (!started) {
    i2c_start();
    started = true;
    due_us = now_us() + period_us;
  }
  for (receive_frames(); now_us() < due_us; receive_frames()) wait_for_interrupt();
  sample.time_us = now_us();
  due_us = sample.time_us - due_us < period_us ? due_us + period_us : sample.time_us + period_us;
  front_end.read(sample);
  return &sample;
}

void power_path_set(const PowerPath& wanted) {
  contactor_pins_set(wanted);
  front_end.bleed(wanted.bleed);
}

}  // namespace bms::hal
