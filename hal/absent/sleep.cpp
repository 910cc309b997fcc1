#include "hal/sleep.hpp"

namespace bms::hal {

void set_parked(bool) {}
bool may_switch_off() { return false; }
void switch_off() {}

}  // namespace bms::hal
