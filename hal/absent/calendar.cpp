// No calendar clock.
#include "hal/calendar.hpp"

namespace bms::hal {

void calendar_start() {}
std::optional<std::uint32_t> calendar_s() { return std::nullopt; }
bool calendar_set(std::uint32_t) { return false; }
CalendarState calendar_state() { return CalendarState::absent; }

}  // namespace bms::hal
