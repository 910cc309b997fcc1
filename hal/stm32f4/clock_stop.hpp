// The clock of hal/clock.hpp over a stop of the chip, in which SysTick stands still.
#pragma once

#include <cstdint>

namespace bms::hal::stm32f4 {

/// SysTick and the supervision of the clock stand still from now on. Returns hal::now_us() of now.
std::uint64_t pause_clock();

/// They go on. stopped_us: time since pause_clock().
void resume_clock(std::uint64_t stopped_us);

}  // namespace bms::hal::stm32f4
