// Resistance between battery and frame, from the monitor that this board has (BMS_INSULATION).
//
//   pwm      hal/insulation.hpp
//   iso175   Bender iso175: frame 0x18FF01F4 with R_iso in kohm, little-endian, in bytes 0 and 1; 65535: not known
#pragma once

#include <algorithm>
#include <cstdint>

#include "can/frame.hpp"
#include "hal/accepted_frames.hpp"
#include "hal/bytes.hpp"
#include "hal/insulation.hpp"

namespace bms::firmware {

template <hal::InsulationMonitor kind>
class InsulationMonitor {
 public:
  static constexpr std::uint64_t timeout_us = 5'000'000;

  /// Returns false for a frame that is not the monitor's.
  constexpr bool receive(const can::Frame& frame, std::uint64_t now_us) {
    if (kind != hal::InsulationMonitor::iso175 || !frame.long_id || frame.id != hal::iso175_frame_id) return false;
    if (frame.length < 2) return true;
    const auto kohm = hal::get_bytes<std::uint16_t>(frame.data, 0);
    ohm_ = kohm <= most_kohm ? kohm * 1'000 : measurement::no_reading;
    received_us_ = now_us;
    return true;
  }

  hal::Insulation now(std::uint64_t now_us) const {
    if constexpr (kind != hal::InsulationMonitor::iso175) return hal::insulation();
    return {true, now_us - received_us_ < timeout_us ? ohm_ : measurement::no_reading};
  }

 private:
  static constexpr std::uint16_t most_kohm = 35'000;

  std::int32_t ohm_ = measurement::no_reading;
  std::uint64_t received_us_ = 0;
};

}  // namespace bms::firmware
