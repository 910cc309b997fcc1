// The host's clock, which the board cannot set.
#include "hal/calendar.hpp"
#include "hal/emulated/semihosting.hpp"

namespace bms::hal {

void calendar_start() {}
std::optional<std::uint32_t> calendar_s() { return semihosting::seconds_since_1970(); }
bool calendar_set(std::uint32_t) { return false; }
CalendarState calendar_state() { return CalendarState::runs; }
std::uint32_t backup_word(std::size_t) { return 0; }
void set_backup_word(std::size_t, std::uint32_t) {}

}  // namespace bms::hal
