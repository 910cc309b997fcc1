// How the core came to run, and how it ends.
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

/// Of the last reset; read once at start-up.
ResetCause reset_cause();

/// What the core saw when it faulted (ARMv7-M, section B1.5): kept over the reset that follows.
struct FaultRecord {
  std::uint32_t exception =
      0;  ///< 2 NMI, 3 hard, 4 memory, 5 bus, 6 usage fault; 16 and above: an interrupt nobody serves
  std::uint32_t pc = 0, lr = 0, psr = 0;
  std::uint32_t cfsr = 0;     ///< configurable fault status
  std::uint32_t hfsr = 0;     ///< hard fault status
  std::uint32_t address = 0;  ///< that was accessed, if cfsr says it is valid
};

/// The fault that ended the last run, if one did.
std::optional<FaultRecord> last_fault();

/// Ends the program: under a debugger with this exit code, else by a reset.
[[noreturn]] void finish(int code);

}  // namespace bms::hal
