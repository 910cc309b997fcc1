// On a board there is nothing to return to.
#include "hal/power.hpp"
#include "hal/stm32f4/power.hpp"

namespace bms::hal {

void finish(int) { stm32f4::system_reset(); }

}  // namespace bms::hal
