// No CAN bus.
#include "hal/can.hpp"

namespace bms::hal {

void can_start(const CanSettings&) {}
bool can_listening() { return false; }
bool can_send(const can::Frame&) { return false; }
bool can_receive(can::Frame&) { return false; }
CanHealth can_health() { return {}; }

}  // namespace bms::hal
