// Identifiers that the firmware receives. A back end with acceptance filters rejects all others.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: vehicle_profile, canopen_node
#include "hal/sample_frames.hpp"

namespace bms::hal {

// firmware/commands.hpp compares these with the DBC file; the data id of each is its identifier
inline constexpr std::uint16_t stop_frame_id = 0x0A0, command_frame_id = 0x1A0, service_request_frame_id = 0x1B0,
                               command_authority_frame_id = 0x1B1, drive_request_frame_id = 0x1B2;
inline constexpr std::uint32_t request_code = 4;  ///< of a Command: a request for power

/// Of a CANopen charger (firmware/cia418_profile.hpp): network management, requests to the battery's SDO server and,
/// the last one, the charger's heartbeat.
inline constexpr auto charger_ids = [] {
  if constexpr (vehicle_profile == VehicleProfile::cia418)
    return std::array<std::uint16_t, 3>{0x000, 0x600 + canopen_node, 0x700 + canopen_charger};
  else
    return std::array<std::uint16_t, 0>{};
}();

/// Stops, commands, the frames of service sessions, requests; a charger's frames if it is on this bus, and otherwise
/// those that every node of a CANopen bus receives.
inline constexpr auto request_ids = [] {
  constexpr std::array<std::uint16_t, 5> own{stop_frame_id, command_frame_id, service_request_frame_id,
                                             command_authority_frame_id, drive_request_frame_id};
  constexpr std::size_t others = has_charger_bus && !charger_ids.empty() ? charger_ids.size() - 1 : charger_ids.size();
  std::array<std::uint16_t, own.size() + others> ids{};
  std::ranges::copy(own, ids.begin());
  std::copy_n(charger_ids.begin(), others, ids.begin() + own.size());
  return ids;
}();

/// Also the identifiers of hal/sample_frames.hpp, for an image without a measuring chain of its own.
inline constexpr auto request_and_sample_ids = [] {
  constexpr std::size_t of_samples = last_sample_frame_id - first_sample_frame_id + 1;
  std::array<std::uint16_t, of_samples + request_ids.size()> ids{};
  for (std::size_t k = 0; k < of_samples; ++k) ids[k] = static_cast<std::uint16_t>(first_sample_frame_id + k);
  std::copy(request_ids.begin(), request_ids.end(), ids.begin() + of_samples);
  return ids;
}();

/// 29-bit identifiers of chargers and of an insulation monitor that the battery receives: those with the bits of `id`
/// where `mask` has ones.
struct LongId {
  std::uint32_t id, mask;
  constexpr bool matches(std::uint32_t other) const { return ((id ^ other) & mask) == 0; }
};
inline constexpr std::uint32_t iso175_frame_id = 0x18FF'01F4;
inline constexpr auto charger_long_ids = [] {
  if constexpr (vehicle_profile == VehicleProfile::elcon)
    return std::array<LongId, 1>{{{0x18FF'50E5, 0x1FFF'FFFF}}};
  else if constexpr (vehicle_profile == VehicleProfile::j1939)  // address claimed; request for a parameter group
    return std::array<LongId, 2>{{{0x00EE'0000, 0x00FF'0000}, {0x00EA'0000, 0x00FF'0000}}};
  else
    return std::array<LongId, 0>{};
}();

inline constexpr auto long_ids = [] {
  constexpr bool monitored = insulation_monitor == InsulationMonitor::iso175;
  constexpr std::size_t of_charger = has_charger_bus ? 0 : charger_long_ids.size();
  std::array<LongId, of_charger + (monitored ? 1 : 0)> ids{};
  std::copy_n(charger_long_ids.begin(), of_charger, ids.begin());
  if constexpr (monitored) ids.back() = {iso175_frame_id, 0x1FFF'FFFF};
  return ids;
}();

/// Received from the charger's own bus (hal/charger_bus.hpp), and there only.
inline constexpr auto charger_bus_ids = [] {
  std::array<std::uint16_t, has_charger_bus ? charger_ids.size() : 0> ids{};
  std::copy_n(charger_ids.begin(), ids.size(), ids.begin());
  return ids;
}();
inline constexpr auto charger_bus_long_ids = [] {
  std::array<LongId, has_charger_bus ? charger_long_ids.size() : 0> ids{};
  std::copy_n(charger_long_ids.begin(), ids.size(), ids.begin());
  return ids;
}();

/// The identifiers that this image receives: one of the lists above, by the source of its samples. Back ends: absent/
/// starting_point, remote/samples.
std::span<const std::uint16_t> accepted_ids();

}  // namespace bms::hal
