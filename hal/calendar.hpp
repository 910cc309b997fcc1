// Calendar clock that runs while the power is off, and words that its supply preserves. Back ends: stm32f4/calendar
// (own supply and crystal), emulated/calendar (the host's clock), absent/calendar (a board without a backup battery).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "hal/board_state.hpp"

namespace bms::hal {

/// Call once, before the other functions. Returns at once.
void calendar_start();

/// Seconds since 1970-01-01 UTC; nothing if the board has no calendar clock, it was not set, or it lost its supply.
std::optional<std::uint32_t> calendar_s();

/// unix_s: 2000-01-01 to 2099-12-31. Returns false if the time is outside this range, if the board has no calendar
/// clock, or if its oscillator is not ready yet: it may need five seconds after the start of the board.
bool calendar_set(std::uint32_t unix_s);

CalendarState calendar_state();

inline constexpr std::size_t backup_words = 4;
/// k below backup_words. 0 if the board has no backup supply. After a loss of that supply the content is undefined, so
/// the user of it needs a checksum.
std::uint32_t backup_word(std::size_t k);
void set_backup_word(std::size_t k, std::uint32_t value);

}  // namespace bms::hal
