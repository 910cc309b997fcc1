// The watchdog of the storage tests counts how often it is fed.
#pragma once

namespace bms::hal {

extern int fed;

}  // namespace bms::hal
