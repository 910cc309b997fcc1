// No bus between batteries.
#include "hal/group_bus.hpp"

namespace bms::hal {

void group_can_start(const CanSettings&) {}
bool group_can_listening() { return false; }
bool group_can_send(const can::Frame&) { return false; }
bool group_can_receive(can::Frame&) { return false; }
CanHealth group_can_health() { return {}; }

}  // namespace bms::hal
