// The supply is not monitored.
#include "hal/supply.hpp"

namespace bms::hal {

void supply_attend() {}
std::uint32_t supply_falls() { return 0; }
void supply_acknowledge(std::uint32_t) {}

}  // namespace bms::hal
