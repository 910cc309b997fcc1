// A clock that goes on while the power is off. Back ends: emulated/calendar (the host's), absent/calendar (a board without a battery for it).
#pragma once

#include <cstdint>
#include <optional>

namespace bms::hal {

/// Seconds since some fixed day, the same in every run; nothing where no clock runs on.
std::optional<std::uint32_t> calendar_s();

}  // namespace bms::hal
