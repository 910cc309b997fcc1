// Reset cause.
#include "hal/power.hpp"

#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

/// csr: RM0090, 7.3.21. Several bits may be set; the more specific cause comes first.
ResetCause cause_of(std::uint32_t csr) {
  if ((csr & 1U << 29) != 0 || (csr & 1U << 30) != 0) return ResetCause::watchdog;
  if ((csr & 1U << 31) != 0) return ResetCause::low_power;
  if ((csr & 1U << 28) != 0) return ResetCause::software;
  if ((csr & 1U << 27) != 0) return ResetCause::power_on;
  if ((csr & 1U << 25) != 0) return ResetCause::brown_out;
  if ((csr & 1U << 26) != 0) return ResetCause::pin;
  return ResetCause::unknown;
}

ResetCause read_reset_cause() {
  const ResetCause cause = cause_of(stm32f4::rcc_csr());
  stm32f4::rcc_csr() = stm32f4::rcc_csr() | 1U << 24;  // RMVF clears the cause
  return cause;
}

const ResetCause cause = read_reset_cause();  // before main(): the register is cleared after it was read

}  // namespace

ResetCause reset_cause() { return cause; }

}  // namespace bms::hal
