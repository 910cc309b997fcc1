// The chip's own converter measures both poles of the DC link.
#include "hal/adc/dc_link.hpp"
#include "hal/adc/conversions.hpp"
#include "hal/power_path.hpp"

namespace bms::hal {

LinkVoltages link_voltages() {
  const std::int32_t supply_uv = adc::measured_supply_uv();
  const std::uint32_t plus = adc::sum_of(AnalogInput::link_plus, adc::link_conversions),
                      minus = adc::sum_of(AnalogInput::link_minus, adc::link_conversions);
  if (supply_uv == 0 || plus == 0 || minus == 0) return {};
  return {adc::link_uv(plus, supply_uv), adc::link_uv(minus, supply_uv)};
}

}  // namespace bms::hal
