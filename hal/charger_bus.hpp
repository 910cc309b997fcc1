// The bus of the charger, for the profiles of chargers: that of the truck, or a second controller (BMS_CHARGER_BUS).
// Then each bus carries its own messages only, has its own bit rate, errors and recovery, and a bus that is off, cut or
// full changes nothing on the other one.
//
// Back ends of the second controller: stm32f4/bxcan (CAN2); absent/ (nobody listens). Its functions do what those of
// hal/can.hpp and hal/can_suspend.hpp with the same names do.
#pragma once

#include <array>
#include <cstdint>

#include "hal/accepted_frames.hpp"
#include "hal/can.hpp"

namespace bms::hal {

/// No identifier of the battery's own messages is there, so none is moved.
inline constexpr CanSettings charger_bus_settings{charger_bit_rate, Identifiers::dbc_base, Identifiers::dbc_stop};

/// settings: the bit rate is that of the build.
void charger_can_start(const CanSettings& settings = charger_bus_settings);
bool charger_can_listening();
bool charger_can_send(const can::Frame& frame);
bool charger_can_receive(can::Frame& frame);
CanHealth charger_can_health();
bool charger_can_suspend(std::uint64_t quiet_us);
bool charger_can_quiet(std::uint64_t quiet_us);
void charger_can_active();

/// Start, errors and bus-off of the second controller. Call it about every 10 ms.
inline void charger_bus_service() {
  if constexpr (has_charger_bus) charger_can_listening();
}

/// Returns true if another node of the charger's bus would receive a frame.
inline bool charger_listening() {
  if constexpr (has_charger_bus)
    return charger_can_listening();
  else
    return can_listening();
}

/// Returns false if this frame or a less urgent one was dropped.
inline bool send_to_charger(const can::Frame& frame) {
  if constexpr (has_charger_bus)
    return charger_can_send(frame);
  else
    return can_send(frame);
}

}  // namespace bms::hal
