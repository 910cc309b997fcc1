// The bus between batteries at one DC link (BMS_PARALLEL): a second controller that carries nothing but the frames of
// firmware/can/parallel_bus.dbc. A bus that is off, cut or full changes nothing on the one of the truck.
//
// Back ends: stm32f4/bxcan (CAN2); absent/ (nobody listens). Its functions do what those of hal/can.hpp with the same
// names do.
#pragma once

#include <array>
#include <cstdint>

#include "hal/accepted_frames.hpp"
#include "hal/can.hpp"

namespace bms::hal {

inline constexpr std::uint32_t group_bit_rate = 250'000;  ///< [bit/s]
/// Presence1 to 4 and BatteryLimits1 to 4; firmware/group_side.hpp compares these with the DBC file.
inline constexpr std::array<std::uint16_t, has_group_bus ? 8 : 0> group_bus_ids = [] {
  constexpr std::array<std::uint16_t, 8> ids{0x101, 0x102, 0x103, 0x104, 0x111, 0x112, 0x113, 0x114};
  std::array<std::uint16_t, has_group_bus ? ids.size() : 0> own{};
  std::copy_n(ids.begin(), own.size(), own.begin());
  return own;
}();
/// No identifier of the battery's own messages is there, so none is moved.
inline constexpr CanSettings group_bus_settings{group_bit_rate, Identifiers::dbc_base, Identifiers::dbc_stop};

/// settings: the bit rate is group_bit_rate.
void group_can_start(const CanSettings& settings = group_bus_settings);
bool group_can_listening();
bool group_can_send(const can::Frame& frame);
bool group_can_receive(can::Frame& frame);
CanHealth group_can_health();
bool group_can_suspend(std::uint64_t quiet_us);
bool group_can_quiet(std::uint64_t quiet_us);
void group_can_active();

/// Start, errors and bus-off of the second controller. Call it about every 10 ms.
inline void group_bus_service() {
  if constexpr (has_group_bus) group_can_listening();
}

}  // namespace bms::hal
