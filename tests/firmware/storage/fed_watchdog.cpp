#include "tests/firmware/storage/fed_watchdog.hpp"

#include "hal/watchdog.hpp"

namespace bms::hal {

int fed = 0;
void watchdog_feed() { ++fed; }

}  // namespace bms::hal
