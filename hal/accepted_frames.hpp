// What the firmware listens to on the bus: a back end with acceptance filters lets nothing else in.
#pragma once

#include <array>
#include <cstdint>

#include "hal/sample_frames.hpp"

namespace bms::hal {

inline constexpr std::uint16_t command_frame_id = 0x1A0;  // firmware/commands.hpp holds it to be the DBC file's

inline constexpr std::array<std::uint16_t, 4> accepted_ids{reading_frame_id, time_frame_id, start_frame_id, command_frame_id};

}  // namespace bms::hal
