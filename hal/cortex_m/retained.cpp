#include "hal/retained.hpp"

namespace bms::hal {

namespace {

[[gnu::section(".noinit")]] RetainedRam retained;

}  // namespace

RetainedRam& retained_ram() { return retained; }

}  // namespace bms::hal
