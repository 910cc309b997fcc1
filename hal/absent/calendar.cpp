// No calendar clock.
#include "hal/calendar.hpp"

namespace bms::hal {

void calendar_start() {}
std::optional<std::uint32_t> calendar_s() { return std::nullopt; }
bool calendar_set(std::uint32_t) { return false; }
CalendarState calendar_state() { return CalendarState::absent; }
std::uint32_t backup_word(std::size_t) { return 0; }
void set_backup_word(std::size_t, std::uint32_t) {}

}  // namespace bms::hal
