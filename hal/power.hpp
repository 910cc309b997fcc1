// Reset cause, record of the last processor fault, and end of the program.
#pragma once

#include <cstdint>
#include <optional>

namespace bms::hal {

enum class ResetCause : std::uint8_t {
  unknown = 0,
  power_on = 1,
  pin = 2,
  software = 3,
  watchdog = 4,
  brown_out = 5,
  low_power = 6
};

/// Cause of the last reset, read once at start-up.
ResetCause reset_cause();

/// Registers of the core at a processor fault (ARMv7-M, section B1.5). The record survives the reset that follows.
struct FaultRecord {
  std::uint32_t exception = 0;  ///< 2 NMI, 3 hard, 4 memory, 5 bus, 6 usage fault; >= 16: interrupt without handler
  std::uint32_t pc = 0, lr = 0, psr = 0;
  std::uint32_t cfsr = 0;     ///< configurable fault status
  std::uint32_t hfsr = 0;     ///< hard fault status
  std::uint32_t address = 0;  ///< address of the access, if cfsr marks it as valid
};

/// The processor fault that ended the last run, if any.
std::optional<FaultRecord> last_fault();

/// Ends the program: under a debugger with this exit code, otherwise by a reset.
[[noreturn]] void finish(int code);

}  // namespace bms::hal
