// Rest between two samples. While the battery is parked and its bus is silent, the chip stops in between: samples,
// protections and balancing go on as always, the core and its oscillators stand still for most of the time.
//
// Back ends: stm32f4/sleep (stop mode), absent/sleep (never).
#pragma once

#include <cstdint>

namespace bms::hal {

/// Silence of the bus before the chip stops.
inline constexpr std::uint64_t silence_before_stop_us = 10'000'000;

/// Call once per sample. parked: all contactors are open, and nobody asks for power.
void set_parked(bool parked);

/// switch_off() would act at once: the truck's side of main plus has no voltage, which holds the measuring chip on.
bool may_switch_off();

/// Switches the measuring chip off, and with it the supply of this core where it is wired so, unless key or plug keep
/// it on. Only of a build with BMS_SWITCHES_OFF (firmware/shelf.hpp). The stored state is complete before. Returns,
/// because the supply does not fall at once.
void switch_off();

/// Returns with the next interrupt, at the latest at due_us [us, hal::now_us()].
void rest_until(std::uint64_t due_us);

}  // namespace bms::hal
