// The chip's own converter measures both poles of the DC link, and a Hall sensor as second current sensor.
//
// The Hall sensor's value at no current depends on its supply, which is not measured: 2 % of 5 V are 20 A. It is
// learned while all outputs are off, over 0.8 s; until then the second current is not known.
#include "hal/adc/dc_link.hpp"
#include "hal/adc.hpp"
#include "hal/contactor_pins.hpp"
#include "hal/power_path.hpp"
#include "hal/second_current.hpp"

namespace bms::hal {

namespace {

constexpr std::int32_t most_offset_ua = 40'000'000;
constexpr std::uint8_t learning_samples = 8;

bool started = false;
std::int32_t zero_ua = 0;
std::uint8_t open_samples = 0;  ///< in a row with all outputs off
bool learned = false;

/// Sum of n conversions, or 0 if one of them fails: no input that works has 0 counts.
std::uint32_t sum_of(AnalogInput input, std::uint32_t n) {
  std::uint32_t sum = 0;
  for (; n > 0; --n) {
    const auto counts = adc_convert(input);
    if (!counts) return 0;
    sum += *counts;
  }
  return sum;
}

std::int32_t measured_supply_uv() {
  if (!started) adc_start();
  started = true;
  return adc::supply_uv(sum_of(AnalogInput::reference, adc::reference_conversions), adc_reference_at_3v3());
}

}  // namespace

LinkVoltages link_voltages() {
  const std::int32_t supply_uv = measured_supply_uv();
  const std::uint32_t plus = sum_of(AnalogInput::link_plus, adc::link_conversions),
                      minus = sum_of(AnalogInput::link_minus, adc::link_conversions);
  if (supply_uv == 0 || plus == 0 || minus == 0) return {};
  return {adc::link_uv(plus, supply_uv), adc::link_uv(minus, supply_uv)};
}

std::int32_t second_current_ua() {
  const std::int32_t supply_uv = measured_supply_uv();
  const std::uint32_t sum = sum_of(AnalogInput::current, adc::hall_conversions);
  if (supply_uv == 0 || sum == 0) return measurement::no_reading;
  const std::int32_t ua = adc::hall_ua(sum, supply_uv);
  if (contactor_pins_on())
    open_samples = 0;
  else if (open_samples < learning_samples)
    ++open_samples;
  if (open_samples == learning_samples && ua < most_offset_ua && ua > -most_offset_ua) {
    zero_ua = learned ? zero_ua + (ua - zero_ua) / 8 : ua;
    learned = true;
  }
  return learned ? ua - zero_ua : measurement::no_reading;
}

}  // namespace bms::hal
