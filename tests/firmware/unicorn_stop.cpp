// Stop mode of the emulated chip (unicorn_board.hpp).
#include <utility>

#include "tests/firmware/unicorn_board.hpp"

namespace bms::firmware {

/// Lines of EXTI that no plugged peripheral drives.
void UnicornBoard::watch_lines() {
  if (!std::exchange(bus_was_busy_, can.wire_busy()) && bus_was_busy_ && bus_falls) bus_falls();
  if (rtc == nullptr) return;
  rtc->pass_until(now_us());
  if (!std::exchange(clock_woke_, rtc->wakes()) && clock_woke_ && clock_wakes) clock_wakes();
}

/// RM0090, 5.3.5: PDDS = 0 and SLEEPDEEP. The internal oscillator runs afterwards; this model wants it to run before.
void UnicornBoard::begin_stop() {
  constexpr std::uint32_t deep = 1U << 2, standby = 1U << 1;
  stopped_ = (register_value(0xE000ED10) & deep) != 0;
  if (!stopped_) return;
  ++stops;
  if ((register_value(0x40007000) & standby) != 0) rcc.violations.push_back("standby mode is not modelled");
  if (rcc.core_hz() > 16e6) rcc.violations.push_back("stop mode begins on the PLL");
  if (can.on_the_bus()) can.violations.push_back("bxCAN is on the bus when its clock stops");
}

}  // namespace bms::firmware
