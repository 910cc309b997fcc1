// Reset cause.
#include "hal/power.hpp"

#include "hal/nrf51/registers.hpp"

namespace bms::hal {

namespace {

/// Register RESETREAS. Several bits are set at once: the more telling one first.
ResetCause cause_of(std::uint32_t reason) {
  if ((reason & 1U << 1) != 0) return ResetCause::watchdog;
  if ((reason & 1U << 2) != 0) return ResetCause::software;
  if ((reason & 7U << 16) != 0) return ResetCause::low_power;  // awake from "system off"
  if ((reason & 1U << 0) != 0) return ResetCause::pin;
  return reason == 0 ? ResetCause::power_on : ResetCause::unknown;  // brown-out says as little as power-on
}

ResetCause read_reset_cause() {
  const std::uint32_t reason = nrf51::power_resetreas();
  nrf51::power_resetreas() = reason;  // forget
  return cause_of(reason);
}

const ResetCause cause = read_reset_cause();  // before main(): the register says nothing of it later

}  // namespace

ResetCause reset_cause() { return cause; }

}  // namespace bms::hal
