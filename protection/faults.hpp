// What can be wrong with a pack: one bit each, and the name that the bus, the README and a person read.
//
// The order is that of the bits in frame Faults of can/greybox_bms.dbc; it is never changed, only continued. Names
// become the names of the DBC's signals (words joined, capitals) and stand in its table of first causes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace bms::protection {

enum class Fault : std::uint8_t {
  cell_overvoltage_warning,
  cell_overvoltage,
  cell_overvoltage_severe,
  cell_undervoltage_warning,
  cell_undervoltage,
  cell_undervoltage_severe,
  pack_overvoltage,
  pack_undervoltage,
  charge_overcurrent,
  discharge_overcurrent,
  short_circuit,
  overtemperature_warning,
  overtemperature,
  charge_overtemperature,
  undertemperature,
  charge_undertemperature,
  open_wire,
  imbalance,
  current_implausible,
  sum_mismatch,
  voltage_missing,
  voltage_stuck,
  current_missing,
  temperature_lost,
  temperature_stuck,
  deep_discharge,
  precharge_failed,
  contactor_welded,
  contactor_not_closed,
  samples_missing,
  internal_fault,
  storage_fault,
};

inline constexpr std::size_t fault_count = 32;
inline constexpr std::uint8_t no_fault = 0xFF;

inline constexpr std::array<const char*, fault_count> fault_names = {"cell overvoltage warning",
                                                                     "cell overvoltage",
                                                                     "cell overvoltage severe",
                                                                     "cell undervoltage warning",
                                                                     "cell undervoltage",
                                                                     "cell undervoltage severe",
                                                                     "pack overvoltage",
                                                                     "pack undervoltage",
                                                                     "charge overcurrent",
                                                                     "discharge overcurrent",
                                                                     "short circuit",
                                                                     "overtemperature warning",
                                                                     "overtemperature",
                                                                     "charge overtemperature",
                                                                     "undertemperature",
                                                                     "charge undertemperature",
                                                                     "open wire",
                                                                     "imbalance",
                                                                     "current implausible",
                                                                     "sum mismatch",
                                                                     "voltage missing",
                                                                     "voltage stuck",
                                                                     "current missing",
                                                                     "temperature lost",
                                                                     "temperature stuck",
                                                                     "deep discharge",
                                                                     "precharge failed",
                                                                     "contactor welded",
                                                                     "contactor not closed",
                                                                     "samples missing",
                                                                     "internal fault",
                                                                     "storage fault"};

constexpr const char* name_of(Fault f) { return fault_names[static_cast<std::size_t>(f)]; }
constexpr std::uint32_t bit(Fault f) { return 1U << static_cast<unsigned>(f); }

/// What follows, from mild to grave.
enum class Reaction : std::uint8_t {
  warn,              ///< told, nothing else
  derate,            ///< half the current, either way
  forbid_charge,     ///< none may flow in; contactors stay closed as long as none does
  forbid_discharge,  ///< none may flow out; the same
  open,              ///< no current is allowed; the contactors open when it has ceased, or after a time of grace
  open_now,          ///< severe: the contactors open at once, whatever flows
};

/// How a fault ends when what raised it is beyond its release threshold.
enum class Recovery : std::uint8_t {
  automatic,  ///< after the time in the table
  on_clear,   ///< by a clear command after that time
  service,    ///< kept over a power cycle; after one, by a service command before anything has been closed
};

}  // namespace bms::protection
