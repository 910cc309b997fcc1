// Contactors and balancing resistors, and the voltage of the DC link.
// Back ends: remote/ and emulated/samples_can (the load is on the bus and receives CAN frames), absent/ (nothing to
// switch), adc/samples (hal/contactor_pins.hpp), bq76952/samples (the same; balancing and DC link by the chip).
#pragma once

#include <cstdint>

namespace bms::hal {

struct PowerPath {
  bool main_plus = false, main_minus = false, precharge = false, charge_enable = false;
  std::uint32_t bleed = 0;  ///< one bit per cell: its balancing resistor is on
};

/// Call with every sample. Before the first call and after a reset, all contactors are open.
void power_path_set(const PowerPath& wanted);

/// Voltage of the DC link, on the load side of the contactors [uV]; no_reading: not measured.
std::int32_t dc_link_uv();

}  // namespace bms::hal
