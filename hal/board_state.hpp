// Results of the board's self-tests, at start-up before it trusts its memory, and while it runs.
// Back ends: stm32f4/board_state, absent/ (a replay, or a board without self-tests).
#pragma once

#include <cstdint>

namespace bms::hal {

enum class CalendarState : std::uint8_t {
  absent = 0,     ///< no calendar clock
  never_set = 1,  ///< runs, but was not set, or lost its supply since
  runs = 2,
  runs_roughly = 3,  ///< on an oscillator with an error of up to 50 % (stm32f4/calendar.cpp)
};

struct BoardState {
  // Any of these makes the board unfit: contactors stay open until a later start finds it fit.
  bool ram_failed = false;     ///< a RAM cell did not store what was written
  bool image_failed = false;   ///< the flash differs from the linked image
  bool stack_overrun = false;  ///< the guard words below the stack have changed

  // The board can work with these.
  bool supply_low = false;           ///< the supply is below the detector's threshold now
  bool brown_out_reset_low = false;  ///< the chip resets only below the voltage at which its flash can be programmed
  /// The core runs on its internal oscillator without CAN, or its frequency was wrong: unfit as above.
  bool clock_failed = false;
  CalendarState calendar = CalendarState::absent;
  std::uint16_t stack_free = 0xFFFF;  ///< minimum so far [bytes]; 0xFFFF: not measured

  constexpr bool unfit() const { return ram_failed || image_failed || stack_overrun || clock_failed; }
};

/// Runs the self-tests of the start. Call once, after clock and watchdog, before stored data are used.
void board_start();

/// Call with every sample. Each call searches a further part of the stack and checks a further part of the image; about
/// 5,000 instructions.
BoardState board_state();

}  // namespace bms::hal
