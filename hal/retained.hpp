// RAM that a reset of the core does not change. After a loss of power its content is undefined, so the user of it needs
// a checksum. Back end: cortex_m/retained.
#pragma once

#include <array>
#include <cstdint>

namespace bms::hal {

using RetainedRam = std::array<std::uint8_t, 36>;

RetainedRam& retained_ram();

}  // namespace bms::hal
