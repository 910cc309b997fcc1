// The bus over a stop of the chip (hal/sleep.hpp), in which the controller has no clock.
#pragma once

#include <cstdint>

namespace bms::hal {

/// Returns true if for quiet_us neither a frame nor an acknowledgement of a node has come.
bool can_quiet(std::uint64_t quiet_us);

/// Takes the controller off the bus, if it is quiet and no frame is on the wire. can_receive() and can_listening() take
/// it on the bus again, where it sends nothing until a frame arrives or a second has passed.
bool can_suspend(std::uint64_t quiet_us);

/// A node has begun a frame: the controller stays on the bus from now on for as long as a frame would keep it there.
void can_active();

}  // namespace bms::hal
