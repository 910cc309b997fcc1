#include "hal/calendar.hpp"
#include "hal/emulated/semihosting.hpp"

namespace bms::hal {

std::optional<std::uint32_t> calendar_s() { return semihosting::seconds_since_1970(); }

}  // namespace bms::hal
