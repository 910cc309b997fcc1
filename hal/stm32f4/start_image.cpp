#include "hal/start_image.hpp"

#include "hal/cortex_m/fault_record.hpp"
#include "hal/cortex_m/jump.hpp"
#include "hal/stm32f4/clock_tree.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

/// Flags of RCC_CSR (RM0090, 7.3.21). The pin is pulled by every reset, so it counts only alone.
bool started_by_power() {
  constexpr std::uint32_t low_power = 1U << 31, watchdogs = 3U << 29, software = 1U << 28;
  return (stm32f4::rcc_csr() & (low_power | watchdogs | software)) == 0;
}

void start_image(std::uint32_t vectors) {
  cortex_m::silence_core();
  stm32f4::stop_clocks();
  stm32f4::rcc_apb1enr() = 0;  // the power interface; nothing else is on before an image starts
  cortex_m::jump(vectors);
}

void restart() { cortex_m::system_reset(); }

}  // namespace bms::hal
