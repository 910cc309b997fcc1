// What the board finds out about itself: at its start, before it trusts its memory, and while it runs.
// Back ends: stm32f4/board_state; absent/ (a replay, a board that cannot look).
#pragma once

#include <cstdint>

namespace bms::hal {

enum class CalendarState : std::uint8_t {
  absent = 0,     ///< no clock runs on
  never_set = 1,  ///< it runs, nobody has said what time it is; or its supply was lost since
  runs = 2,
  runs_roughly = 3,  ///< on an oscillator that is off by up to half (hal/calendar.hpp)
};

struct BoardState {
  // what makes the board unfit: contactors stay open until another start finds it fit
  bool ram_failed = false;     ///< a cell did not hold what was written
  bool image_failed = false;   ///< the flash does not hold what was linked
  bool stack_overrun = false;  ///< the words below the stack are not as they were

  // what it can work with
  bool supply_low = false;           ///< the supply is below the detector's threshold, now
  bool brown_out_reset_low = false;  ///< the chip would go on below the voltage that its flash is written with
  bool clock_failed = false;         ///< no crystal: the core runs slower, and CAN is off
  CalendarState calendar = CalendarState::absent;
  std::uint16_t stack_free = 0xFFFF;  ///< least so far [bytes]; 0xFFFF: not measured

  constexpr bool unfit() const { return ram_failed || image_failed || stack_overrun; }
};

/// Once, after the clock and the watchdog run, before what is stored is believed.
void board_start();

/// With every sample; looks further each time, some thousand instructions.
BoardState board_state();

}  // namespace bms::hal
