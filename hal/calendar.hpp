// A clock that goes on while the power is off. Back ends: stm32f4/calendar (its own supply and crystal),
// emulated/calendar (the host's), absent/calendar (a board without a battery for it).
#pragma once

#include <cstdint>
#include <optional>

#include "hal/board_state.hpp"

namespace bms::hal {

/// Once, before the others; does not wait.
void calendar_start();

/// Seconds since 1970-01-01 UTC; nothing where no clock runs on, none was set, or its supply was away.
std::optional<std::uint32_t> calendar_s();

/// 2000-01-01 to 2099-12-31. False: not taken (another time, no clock), or not yet: its oscillator may need five
/// seconds from the start of the board.
bool calendar_set(std::uint32_t unix_s);

CalendarState calendar_state();

}  // namespace bms::hal
