// Insulation monitor between battery and frame. Back ends: stm32f4/insulation_pwm (Bender IR155 and alike),
// firmware/insulation_monitor.hpp (Bender iso175), absent/insulation.
#pragma once

#include <cstdint>

#include "measurement/sample.hpp"

namespace bms::hal {

struct Insulation {
  bool fitted = false;
  std::int32_t ohm = measurement::no_reading;  ///< of the battery to the frame; no_reading: the monitor does not know
};

/// Call once per sample.
Insulation insulation();

}  // namespace bms::hal
