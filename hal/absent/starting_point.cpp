// A board that measures itself: no other node can send its samples or its state of charge, so it receives only
// requests.
#include "hal/accepted_frames.hpp"
#include "hal/samples.hpp"
#include "hal/update_frames.hpp"

namespace bms::hal {

std::optional<measurement::StartingPoint> starting_point() { return std::nullopt; }
std::span<const std::uint16_t> accepted_ids() {
  static constexpr auto ids = with_updates(request_ids);
  return ids;
}

}  // namespace bms::hal
