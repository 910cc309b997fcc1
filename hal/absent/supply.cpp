// The supply is not monitored.
#include "hal/supply.hpp"

namespace bms::hal {

void supply_attend() {}

}  // namespace bms::hal
