// Frames of an update (firmware/boot/update_server.hpp): they do not wait for the next sample, because their sender
// waits for the answer.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "can/frame.hpp"

namespace bms::hal {

inline constexpr std::uint16_t update_frame_id = 0x7B0;

/// A list of accepted identifiers and that of the updates.
template <std::size_t Size>
constexpr std::array<std::uint16_t, Size + 1> with_updates(const std::array<std::uint16_t, Size>& ids) {
  std::array<std::uint16_t, Size + 1> all{};
  std::ranges::copy(ids, all.begin());
  all.back() = update_frame_id;
  return all;
}

/// Every frame with this identifier is given to `listener` when it is dispatched (hal/frame_dispatch.hpp). Without a
/// listener it is dropped.
void listen_for_updates(void (*listener)(const can::Frame& frame));

}  // namespace bms::hal
