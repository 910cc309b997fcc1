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

/// The truck's side of main plus has no voltage, which would hold the measuring chip on.
bool load_side_discharged();

/// A node has begun a frame since the chip stopped last. The frame itself is lost.
bool bus_stirs();

/// Switches the measuring chip off, and with it the supply of this core where it is wired so. Only of a build with
/// BMS_SWITCHES_OFF (firmware/shelf.hpp). The stored state is complete before, and all contactors are open. If key or
/// plug keep the chip on, or the supply does not fall, it resets chip and core, which start as by a key: a back end
/// that has such a chip does not return.
void switch_off();

/// Returns with the next interrupt, at the latest at due_us [us, hal::now_us()].
void rest_until(std::uint64_t due_us);

}  // namespace bms::hal
