// Samples that the board measures itself, one per period of its own clock. Between samples it receives CAN frames:
// requests and the starting point. If the front end does not answer, the sample has no readings, so estimator and
// protection know that nothing is measured.
//
// If the core was stopped (an erase of flash) and a sample is late, the next period starts at this sample; the
// following samples are not early.
//
// The chip opens main plus when its host is silent and would close it again at the next transfer. So after such a
// silence the outputs are switched off before that transfer; protection then receives host_silence.
#include "hal/samples.hpp"
#include "hal/bq76952/front_end.hpp"
#include "hal/bq76952/pack_readings.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/i2c.hpp"
#include "hal/power_path.hpp"
#include "hal/second_line.hpp"
#include "hal/sleep.hpp"

namespace bms::hal {

namespace {

constexpr auto period_us = static_cast<std::uint64_t>(1e6 * sample_period_s);

bq76952::FrontEnd front_end;
measurement::PackSample<pack_cells> sample;
SensorCalibration correction;
std::uint64_t due_us = 0;
std::uint32_t acquired_us = 0;
bool started = false;

void receive_frames() {
  can::Frame frame;
  while (can_receive(frame)) dispatch_frame(frame);
}

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  if (!started) {
    i2c_start();
    front_end.use(bq76952::board_configuration);
    started = true;
    due_us = now_us() + period_us;
  }
  for (receive_frames(); now_us() < due_us; receive_frames()) rest_until(due_us);
  measurement::PackSample<bq76952::cell_inputs> inputs;
  inputs.time_us = now_us();
  due_us = inputs.time_us - due_us < period_us ? due_us + period_us : inputs.time_us + period_us;
  if (front_end.silent()) [[unlikely]]
    contactor_pins_set({});
  front_end.read(inputs);
  bq76952::read_pack(inputs, bq76952::board_configuration, correction, sample);
  acquired_us = static_cast<std::uint32_t>(now_us() - inputs.time_us);
  return &sample;
}

std::uint32_t acquisition_us() { return acquired_us; }

bool calibrate(const SensorCalibration& calibration) {
  correction = calibration;
  return true;
}

std::uint32_t second_line_trips() { return front_end.trips(); }
void second_line_clear() { front_end.clear_latch(); }
FrontEndHealth front_end_health() {
  using State = bq76952::FrontEnd::State;
  const State state = front_end.state();
  FrontEndHealth health{FrontEndState::configuring, front_end.counters().lost, front_end.counters().resets,
                        front_end.wire().bad_crc};
  if (state == State::absent) health.state = FrontEndState::absent;
  if (state == State::measure) health.state = FrontEndState::measuring;
  return health;
}

/// With LD above its threshold (0.8 V or more assumed, 1.45 V typical: E2E 1356033) the chip would wait with its
/// outputs off, and its pins would contradict the protections.
bool may_switch_off() {
  constexpr std::int32_t low_uv = 700'000;
  return front_end.dc_link_uv() != measurement::no_reading && front_end.dc_link_uv() < low_uv;
}
void switch_off() { front_end.shut_down(); }

void power_path_set(const PowerPath& wanted) {
  contactor_pins_set(wanted);
  front_end.bleed(bq76952::inputs_of(bq76952::board_configuration, wanted.bleed));
}

}  // namespace bms::hal
