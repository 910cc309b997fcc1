// What the firmware listens to on the bus: a back end with acceptance filters lets nothing else in.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/sample_frames.hpp"

namespace bms::hal {

inline constexpr std::uint16_t command_frame_id = 0x1A0;  // firmware/commands.hpp holds it to be the DBC file's

/// All of hal/sample_frames.hpp, and commands.
inline constexpr auto accepted_ids = [] {
  std::array<std::uint16_t, last_sample_frame_id - reading_frame_id + 2> ids{};
  for (std::size_t k = 0; k + 1 < ids.size(); ++k) ids[k] = static_cast<std::uint16_t>(reading_frame_id + k);
  ids.back() = command_frame_id;
  return ids;
}();

}  // namespace bms::hal
