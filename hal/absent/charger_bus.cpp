// No bus of the charger.
#include "hal/charger_bus.hpp"

namespace bms::hal {

void charger_can_start(const CanSettings&) {}
bool charger_can_listening() { return false; }
bool charger_can_send(const can::Frame&) { return false; }
bool charger_can_receive(can::Frame&) { return false; }
CanHealth charger_can_health() { return {}; }

}  // namespace bms::hal
