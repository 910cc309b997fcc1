// What only a boot loader needs: why the chip started, and the jump into an image.
// Back ends: stm32f4/start_image, emulated/start_image (QEMU).
#pragma once

#include <cstdint>

namespace bms::hal {

/// Returns true if this start follows a loss of power or the reset pin, false for a watchdog, a fault or a restart that
/// software asked for. Does not clear the cause: the image that starts reads it too.
bool started_by_power();

/// Leaves the chip as after a reset, apart from the watchdog, and starts the image with these vectors.
[[noreturn]] void start_image(std::uint32_t vectors);

/// Resets the chip.
[[noreturn]] void restart();

}  // namespace bms::hal
