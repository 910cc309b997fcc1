// A Hall sensor as second current sensor, measured by the chip's own converter.
//
// The Hall sensor's value at no current depends on its supply, which is not measured: 2 % of 5 V are 20 A. It is
// learned while all outputs are off, over 0.8 s; until then the second current is not known. At the start they have
// been off since the reset, so 0.3 s are enough: a request that goes on closes them again after half a second. A sensor
// that is broken at the start is far from its value at no current, is never learned, and stays without a reading.
//
// An output at one of its rails says nothing: without its 5 V, or with a broken wire, the pin is at 0 V, or at the
// converter's supply, which would read as 1000 A.
#include "hal/second_current.hpp"
#include "hal/adc/conversions.hpp"
#include "hal/contactor_pins.hpp"

namespace bms::hal {

namespace {

constexpr std::int32_t most_offset_ua = 40'000'000;
constexpr std::int32_t most_ua = 990'000'000;  ///< the rails less the errors of the converter, 6 counts
constexpr std::uint8_t learning_samples = 8;

std::int32_t zero_ua = 0;
std::uint8_t open_samples = learning_samples - 3;  ///< in a row with all outputs off
bool learned = false;

}  // namespace

bool second_current_fitted() { return true; }

std::int32_t second_current_ua() {
  const std::int32_t supply_uv = adc::measured_supply_uv();
  const std::uint32_t sum = adc::sum_of(AnalogInput::current, adc::hall_conversions);
  if (supply_uv == 0 || sum == 0) return measurement::no_reading;
  const std::int32_t ua = adc::hall_ua(sum, supply_uv);
  if (ua > most_ua || ua < -most_ua) return measurement::no_reading;
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
