// Heater, fan and SOC lamp (BMS_OUTPUTS).
//
//   heater   while a charger is present: on below 2 K above the temperature from which the cells may be charged, off 5
//   K
//            above that. Off without a reading of every thermistor, and while a fault opens. It is wired behind the
//            charger, so it heats a pack that may not be charged yet and does not discharge it
//   fan      on from 5 K below the temperature from which the charge current is derated, off 5 K below that; on without
//            a reading
//   lamp     while power is requested: above 20 % on, above 10 % it blinks at 1 Hz, below it at 2.5 Hz. Off
//            while the state of charge is not known or a fault opens
#pragma once

#include <algorithm>
#include <cstdint>

#include "hal/truck_inputs.hpp"
#include "measurement/pack_sample.hpp"
#include "protection/protection.hpp"

namespace bms::firmware {

class TruckOutputs {
 public:
  struct Input {
    std::array<std::int16_t, measurement::max_temperatures> cdegc;
    std::int32_t soc_ppb = measurement::no_reading;
    bool charger_present = false, requested = false, opens = false;
    std::uint64_t now_us = 0;
  };

  /// Bits of hal::TruckOutput.
  constexpr std::uint32_t update(const Input& in, const protection::ProtectionPlan& plan) {
    constexpr std::int32_t kelvin = 100;
    std::int32_t lowest = 30'000, highest = -30'000;
    bool complete = plan.limits.temperatures > 0;
    for (std::size_t k = 0; k < plan.limits.temperatures; ++k) {
      complete = complete && measurement::temperature_possible(in.cdegc[k]);
      lowest = std::min<std::int32_t>(lowest, in.cdegc[k]);
      highest = std::max<std::int32_t>(highest, in.cdegc[k]);
    }
    const std::int32_t cold = plan.derating.charge_cold.from, warm = plan.derating.charge_warm.from;
    heats_ = complete && in.charger_present && !in.opens && highest < warm && lowest < cold + (heats_ ? 7 : 2) * kelvin;
    cools_ = !complete || highest > warm - (cools_ ? 10 : 5) * kelvin;
    return bit(hal::TruckOutput::heater, heats_) | bit(hal::TruckOutput::fan, cools_) |
           bit(hal::TruckOutput::soc_lamp, lit(in));
  }

 private:
  static constexpr std::uint32_t bit(hal::TruckOutput output, bool on) {
    return on ? static_cast<std::uint32_t>(output) : 0;
  }
  static constexpr bool lit(const Input& in) {
    constexpr std::int32_t percent = 10'000'000;
    if (!in.requested || in.opens || in.soc_ppb == measurement::no_reading) return false;
    if (in.soc_ppb > 20 * percent) return true;
    return in.now_us / (in.soc_ppb > 10 * percent ? 500'000 : 200'000) % 2 == 0;
  }

  bool heats_ = false, cools_ = false;
};

}  // namespace bms::firmware
