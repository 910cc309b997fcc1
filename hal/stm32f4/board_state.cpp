#include "hal/board_state.hpp"

#include "hal/calendar.hpp"
#include "hal/cortex_m/image_check.hpp"
#include "hal/cortex_m/stack.hpp"
#include "hal/cortex_m/startup.hpp"
#include "hal/stm32f4/clock_check.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/supply.hpp"

namespace bms::hal {

namespace {

/// Read per sample in the background: 0.02 ms. With ten samples per second a pass over 64 KiB takes 25.6 s.
constexpr std::uint32_t image_bytes_per_sample = 256;

bool stack_overrun = false, brown_out_reset_low = false;

}  // namespace

void board_start() {
  cortex_m::image_intact(0xFFFF'FFFF);
  brown_out_reset_low = stm32f4::brown_out_reset_low();
  stm32f4::supply_start();
  stm32f4::clock_check_start();
  calendar_start();
}

BoardState board_state() {
  BoardState state;
  state.ram_failed = cortex_m::ram_failed();
  state.image_failed = !cortex_m::image_intact(image_bytes_per_sample);
  state.stack_overrun = stack_overrun = stack_overrun || !cortex_m::stack_guard_intact();
  state.supply_low = stm32f4::supply_low();
  state.brown_out_reset_low = brown_out_reset_low;
  state.clock_failed = stm32f4::clocks().core_hz != stm32f4::crystal_core_hz || stm32f4::clock_wrong();
  state.calendar = calendar_state();
  state.stack_free = static_cast<std::uint16_t>(cortex_m::stack_free());
  return state;
}

}  // namespace bms::hal
