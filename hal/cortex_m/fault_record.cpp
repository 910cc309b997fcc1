#include "hal/cortex_m/fault_record.hpp"

#include "hal/cortex_m/registers.hpp"

namespace bms::hal {

namespace {

constexpr std::uint32_t magic = 0xFA017BAD;

/// In RAM that start-up does not initialise.
struct StoredFault {
  std::uint32_t magic;
  FaultRecord fault;
  std::uint32_t check;
};
[[gnu::section(".noinit")]] StoredFault stored;

std::optional<FaultRecord> fault;

std::uint32_t check_of(const FaultRecord& f) {
  return magic ^ f.exception ^ f.pc ^ f.lr ^ f.psr ^ f.cfsr ^ f.hfsr ^ f.address;
}

}  // namespace

std::optional<FaultRecord> last_fault() { return fault; }

namespace cortex_m {

void read_stored_fault() {
  if (stored.magic == magic && stored.check == check_of(stored.fault)) fault = stored.fault;
  stored.magic = 0;
}

void store_fault(const FaultRecord& record) {
  stored.fault = record;
  stored.check = check_of(record);
  stored.magic = magic;
}

void system_reset() {
  asm volatile("dsb" ::: "memory");
  scb_aircr() = 0x05FA0000U | 1U << 2;
  while (true) asm volatile("dsb");
}

}  // namespace cortex_m

}  // namespace bms::hal
