// QEMU does not emulate the clock control: its registers read 0, and the core runs at 168 MHz from the start.
#include "hal/stm32f4/clock_tree.hpp"

namespace bms::hal::stm32f4 {

namespace {

constexpr Clocks fixed{168'000'000, 84'000'000};

}  // namespace

Clocks start_clocks() { return fixed; }
void stop_clocks() {}
const Clocks& clocks() { return fixed; }

}  // namespace bms::hal::stm32f4
