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

#include <type_traits>

#include "hal/bq76952/front_end.hpp"
#include "hal/bq76952/pack_readings.hpp"
#include "hal/bq76952/stack.hpp"
#include "hal/can.hpp"
#include "hal/charger_bus.hpp"
#include "hal/clock.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/group_bus.hpp"
#include "hal/i2c.hpp"
#include "hal/power.hpp"
#include "hal/power_path.hpp"
#include "hal/second_line.hpp"
#include "hal/sleep.hpp"
#include "hal/watchdog.hpp"

namespace bms::hal {

namespace {

using namespace bq76952;

/// The measuring chain of a pack of at most 16 cells. Stack has the same members for two chips.
class OneChip {
 public:
  /// Configures the bus. Call once, before the first read().
  void start() {
    i2c_start();
    chip_.use(board_configuration);
  }
  using Inputs = measurement::PackSample<cell_inputs>;
  /// Call once per sample, with inputs.time_us set.
  void read(Inputs& inputs, const SensorCalibration& by, measurement::PackSample<pack_cells>& into) {
    chip_.read(inputs);
    read_pack(inputs, board_configuration, by, into);
  }
  bool silent() const { return chip_.silent(); }
  std::uint32_t trips() const { return chip_.trips(); }
  void clear_latch() { chip_.clear_latch(); }
  FrontEndHealth health() const {
    using State = FrontEnd::State;
    const State state = chip_.state();
    FrontEndHealth health{FrontEndState::configuring, chip_.counters().lost, chip_.counters().resets,
                          chip_.wire().bad_crc, chip_.die_cdegc()};
    if (state == State::absent) health.state = FrontEndState::absent;
    if (state == State::measure) health.state = FrontEndState::measuring;
    return health;
  }
  /// Voltage at LD; measurement::no_reading if unknown.
  std::int32_t dc_link_uv() const { return chip_.dc_link_uv(); }
  void shut_down() { chip_.shut_down(); }
  FrontEnd::AfterShutdown after_shut_down() { return chip_.after_shut_down(); }
  /// cells: one bit per cell of the pack.
  void bleed(std::uint32_t cells) { chip_.bleed(inputs_of(board_configuration, cells)); }

 private:
  FrontEnd chip_;
};

constexpr auto period_us = static_cast<std::uint64_t>(1e6 * sample_period_s);

std::conditional_t<stacked, Stack, OneChip> front_end;
measurement::PackSample<pack_cells> sample;
SensorCalibration correction;
std::uint64_t due_us = 0;
std::uint32_t acquired_us = 0;
bool started = false;

void receive_frames() {
  charger_bus_service();
  group_bus_service();
  can::Frame frame;
  while (can_receive(frame)) dispatch_frame(frame);
}

}  // namespace

const measurement::PackSample<pack_cells>* next_sample() {
  if (!started) {
    front_end.start();
    started = true;
    due_us = now_us() + period_us;
  }
  for (receive_frames(); now_us() < due_us; receive_frames()) rest_until(due_us);
  decltype(front_end)::Inputs inputs;
  inputs.time_us = now_us();
  due_us = inputs.time_us - due_us < period_us ? due_us + period_us : inputs.time_us + period_us;
  if (front_end.silent()) [[unlikely]]
    contactor_pins_set({});
  front_end.read(inputs, correction, sample);
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
FrontEndHealth front_end_health() { return front_end.health(); }

/// With LD above its threshold (0.8 V or more assumed, 1.45 V typical: E2E 1356033) the chip would wait with its
/// outputs off, and its pins would contradict the protections.
bool load_side_discharged() {
  constexpr std::int32_t low_uv = 700'000;
  return front_end.dc_link_uv() != measurement::no_reading && front_end.dc_link_uv() < low_uv;
}

/// A chip that refuses to be reset waits until TS2 is open again, and then takes the supply away. Until then all
/// contactors are open, by this core and by the chip's outputs, and the next key-on is a start like any other.
void switch_off() {
  using enum FrontEnd::AfterShutdown;
  constexpr std::uint64_t ask_again_us = 250'000, supply_falls_us = 1'000'000;
  front_end.shut_down();
  for (std::uint64_t asked_us = now_us(), answered_us = asked_us;;) {
    while (now_us() - asked_us < ask_again_us) wait_for_interrupt();
    asked_us = now_us();
    watchdog_feed();
    const FrontEnd::AfterShutdown chip = front_end.after_shut_down();
    if (chip == held_on) answered_us = asked_us;
    if (chip == restarted || asked_us - answered_us > supply_falls_us) finish(0);
  }
}

void power_path_set(const PowerPath& wanted) {
  contactor_pins_set(wanted);
  front_end.bleed(wanted.bleed);
}

}  // namespace bms::hal
