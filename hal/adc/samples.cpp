// Samples of one cell by the chip's own converter, one per period of the board's clock. Every millisecond each input is
// converted once, the current four times. A sample is the mean of these, so it contains current changes within the
// period, except in the millisecond in which the last sample was processed.
//
// Contactors are switched by pins; the DC link is not measured.
#include "hal/samples.hpp"
#include "hal/adc.hpp"
#include "hal/adc/cell_readings.hpp"
#include "hal/calibration.hpp"
#include "hal/can.hpp"
#include "hal/clock.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/frame_dispatch.hpp"
#include "hal/power_path.hpp"

namespace bms::hal {

namespace {

static_assert(pack_cells == 1);
constexpr auto period_us = static_cast<std::uint64_t>(1e6 * sample_period_s);
constexpr adc::AnalogFrontEnd front_end;
constexpr std::uint32_t currents_per_round = 4;

SensorCalibration correction;
measurement::PackSample<1> pack;
std::uint64_t due_us = 0;
std::uint32_t acquired_us = 0;
bool started = false;

void receive_frames() {
  can::Frame frame;
  while (can_receive(frame)) dispatch_frame(frame);
}

/// Adds one conversion of each input, four of the current. Adds nothing if one of them fails.
void convert(adc::AdcCounts& sums) {
  const auto voltage = adc_convert(AnalogInput::voltage), temperature = adc_convert(AnalogInput::temperature),
             reference = adc_convert(AnalogInput::reference);
  std::uint32_t current = 0;
  for (std::uint32_t k = 0; k < currents_per_round; ++k) {
    const auto one = adc_convert(AnalogInput::current);
    if (!one) return;
    current += *one;
  }
  if (!voltage || !temperature || !reference) return;
  ++sums.n;
  sums.voltage += *voltage;
  sums.temperature += *temperature;
  sums.current += current;
  ++sums.n_reference;
  sums.reference += *reference;
}

}  // namespace

bool calibrate(const SensorCalibration& calibration) {
  correction = calibration;
  return true;
}

const measurement::PackSample<1>* next_sample() {
  if (!started) {
    adc_start();
    started = true;
    due_us = now_us() + period_us;
  }
  adc::AdcCounts sums;
  std::uint64_t round_us = now_us();
  for (receive_frames(); now_us() < due_us; receive_frames()) {
    wait_for_interrupt();
    if (now_us() < round_us) continue;  // another interrupt within the millisecond
    convert(sums);
    round_us += 1'000;
  }
  measurement::Sample sample;
  sample.time_us = now_us();
  due_us = sample.time_us - due_us < period_us ? due_us + period_us : sample.time_us + period_us;
  sums.current = (sums.current + currents_per_round / 2) / currents_per_round;
  adc::read(sums, adc_reference_at_3v3(), front_end, correction, sample);
  pack.time_us = sample.time_us;
  pack.current_ua = sample.current_ua;
  pack.cell_uv[0] = pack.pack_uv = sample.voltage_uv;
  pack.temperature_cdegc[0] = sample.temperature_cdegc;
  acquired_us = static_cast<std::uint32_t>(now_us() - sample.time_us);
  return &pack;
}

std::uint32_t acquisition_us() { return acquired_us; }

void power_path_set(const PowerPath& wanted) { contactor_pins_set(wanted); }
LinkVoltages link_voltages() { return {}; }

}  // namespace bms::hal
