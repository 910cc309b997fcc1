// Identifiers that the firmware receives. A back end with acceptance filters rejects all others.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "board_config.hpp"  // generated from boards/<board>/board.cmake: vehicle_profile, canopen_node
#include "hal/sample_frames.hpp"

namespace bms::hal {

inline constexpr std::uint16_t command_frame_id = 0x1A0;  // firmware/commands.hpp compares it with the DBC file

/// Network management and requests to the battery's SDO server, in an image that is a CANopen node
/// (firmware/cia418_profile.hpp).
inline constexpr auto profile_ids = [] {
  if constexpr (vehicle_profile == VehicleProfile::cia418)
    return std::array<std::uint16_t, 2>{0x000, 0x600 + canopen_node};
  else
    return std::array<std::uint16_t, 0>{};
}();

/// Identifiers of hal/sample_frames.hpp, of commands and of the vehicle profile.
inline constexpr auto accepted_ids = []() {
  constexpr std::size_t of_samples = last_sample_frame_id - first_sample_frame_id + 1;
  std::array<std::uint16_t, of_samples + 1 + profile_ids.size()> ids{};
  for (std::size_t k = 0; k < of_samples; ++k) ids[k] = static_cast<std::uint16_t>(first_sample_frame_id + k);
  ids[of_samples] = command_frame_id;
  for (std::size_t k = 0; k < profile_ids.size(); ++k) ids[of_samples + 1 + k] = profile_ids[k];
  return ids;
}();

}  // namespace bms::hal
