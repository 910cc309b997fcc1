// What the battery switches, and what it measures beyond its cells.
// Back ends: remote/ (the load is on the bus: told by frames), absent/ (nothing to switch), bq76952/samples (contactors
// by hal/contactor_pins.hpp, bleeding and link by the chip).
#pragma once

#include <cstdint>

namespace bms::hal {

struct PowerPath {
  bool main_plus = false, main_minus = false, precharge = false, charge_enable = false;
  std::uint32_t bleed = 0;  ///< cells whose balancing resistor is on, a bit each
};

/// With every sample. All open before the first call, and after a reset.
void power_path_set(const PowerPath& wanted);

/// On the load's side of the contactors [uV]; no_reading: not measured.
std::int32_t dc_link_uv();

}  // namespace bms::hal
