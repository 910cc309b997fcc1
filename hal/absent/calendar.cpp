// Time stops with the power.
#include "hal/calendar.hpp"

namespace bms::hal {

std::optional<std::uint32_t> calendar_s() { return std::nullopt; }

}  // namespace bms::hal
