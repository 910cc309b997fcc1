#include "hal/sleep.hpp"

namespace bms::hal {

void set_parked(bool) {}
bool load_side_discharged() { return false; }
bool bus_stirs() { return false; }
void switch_off() {}

}  // namespace bms::hal
