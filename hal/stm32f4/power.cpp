// Reset cause, and the record that a fault leaves behind for the run after it.
#include "hal/power.hpp"

#include "hal/stm32f4/power.hpp"
#include "hal/stm32f4/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t magic = 0xFA017BAD;

/// In RAM that start-up leaves alone.
struct Kept {
  std::uint32_t magic;
  FaultRecord fault;
  std::uint32_t check;
};
[[gnu::section(".noinit")]] Kept kept;

ResetCause cause = ResetCause::unknown;
std::optional<FaultRecord> fault;

std::uint32_t check_of(const FaultRecord& f) { return magic ^ f.exception ^ f.pc ^ f.lr ^ f.psr ^ f.cfsr ^ f.hfsr ^ f.address; }

/// RM0090, 7.3.21. Several bits are set at once: the more telling one first.
ResetCause cause_of(std::uint32_t csr) {
  if ((csr & 1U << 29) != 0 || (csr & 1U << 30) != 0) return ResetCause::watchdog;
  if ((csr & 1U << 31) != 0) return ResetCause::low_power;
  if ((csr & 1U << 28) != 0) return ResetCause::software;
  if ((csr & 1U << 27) != 0) return ResetCause::power_on;
  if ((csr & 1U << 25) != 0) return ResetCause::brown_out;
  if ((csr & 1U << 26) != 0) return ResetCause::pin;
  return ResetCause::unknown;
}

}  // namespace

ResetCause reset_cause() { return cause; }
std::optional<FaultRecord> last_fault() { return fault; }

namespace stm32f4 {

void read_reset_cause() {
  cause = cause_of(rcc_csr());
  rcc_csr() = rcc_csr() | 1U << 24;  // forget
  if (kept.magic == magic && kept.check == check_of(kept.fault)) fault = kept.fault;
  kept.magic = 0;
}

void keep(const FaultRecord& record) {
  kept.fault = record;
  kept.check = check_of(record);
  kept.magic = magic;
}

void system_reset() {
  asm volatile("dsb" ::: "memory");
  scb_aircr() = 0x05FA0000U | 1U << 2;
  while (true) asm volatile("dsb");
}

}  // namespace stm32f4

}  // namespace bms::hal
