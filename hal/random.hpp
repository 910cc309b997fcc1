// Random numbers for challenges. Back ends: stm32f4/random (the chip's generator), absent/ (none: challenges then only
// differ by what the firmware adds, firmware/challenge_source.hpp).
#pragma once

#include <cstdint>

namespace bms::hal {

/// 32 random bits; 0 if the generator does not work. Takes at most some 10 us.
std::uint32_t random_word();

}  // namespace bms::hal
