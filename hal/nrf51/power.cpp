// Reset cause.
#include "hal/power.hpp"

#include "hal/nrf51/registers.hpp"

namespace bms::hal {

namespace {

/// reason: register RESETREAS. Several bits may be set; the more specific cause comes first.
ResetCause cause_of(std::uint32_t reason) {
  if ((reason & 1U << 1) != 0) return ResetCause::watchdog;
  if ((reason & 1U << 2) != 0) return ResetCause::software;
  if ((reason & 7U << 16) != 0) return ResetCause::low_power;  // wake-up from "system off"
  if ((reason & 1U << 0) != 0) return ResetCause::pin;
  return reason == 0 ? ResetCause::power_on : ResetCause::unknown;  // a brown-out sets no bit either
}

ResetCause read_reset_cause() {
  const std::uint32_t reason = nrf51::power_resetreas();
  nrf51::power_resetreas() = reason;  // cleared by writing 1
  return cause_of(reason);
}

const ResetCause cause = read_reset_cause();  // before main(): the register is cleared after it was read

}  // namespace

ResetCause reset_cause() { return cause; }

}  // namespace bms::hal
