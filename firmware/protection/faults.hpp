// Faults of a pack: one bit each, and the name that the bus, the README and people use.
//
// The order is the order of the bits in the frames Faults (bits 0 to 31) and MoreFaults (from bit 32 on) of
// firmware/can/greybox_bms.dbc. It never changes; new faults are added at the end. The names become the DBC's signal
// names (joined words in capitals) and stand in its table of first causes.
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
  second_line_tripped,
  second_line_failed,
  current_sensors_differ,
  temperature_unknown,
  current_unrequested,
  allowed_current_exceeded,
  charge_limit_exceeded,
  discharge_limit_exceeded,
  limit_not_obeyed,
  supply_dip,
  thermistor_shorted,
  second_current_missing,
  interlock_open,
  crash,
  insulation_low,
  insulation_unknown,
  front_end_hot,
  group_incomplete,
};

/// One bit for each fault: bit k is Fault k.
using FaultSet = std::uint64_t;

/// Images without a bus between batteries (BMS_PARALLEL) have neither the last row nor its quantity.
#ifdef BMS_WITHOUT_GROUP
inline constexpr bool with_group = false;
#else
inline constexpr bool with_group = true;
#endif
inline constexpr std::size_t known_faults = 50, fault_count = with_group ? known_faults : known_faults - 1;
static_assert(fault_count <= 62, "signal Faults.FirstCause has six bits and a value for not known");
inline constexpr std::uint8_t no_fault = 0xFF;

inline constexpr std::array<const char*, known_faults> fault_names = {"cell overvoltage warning",
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
                                                                      "storage fault",
                                                                      "second line tripped",
                                                                      "second line failed",
                                                                      "current sensors differ",
                                                                      "temperature unknown",
                                                                      "current unrequested",
                                                                      "allowed current exceeded",
                                                                      "charge limit exceeded",
                                                                      "discharge limit exceeded",
                                                                      "limit not obeyed",
                                                                      "supply dip",
                                                                      "thermistor shorted",
                                                                      "second current missing",
                                                                      "interlock open",
                                                                      "crash",
                                                                      "insulation low",
                                                                      "insulation unknown",
                                                                      "front end hot",
                                                                      "group incomplete"};

constexpr const char* name_of(Fault f) { return fault_names[static_cast<std::size_t>(f)]; }
constexpr FaultSet bit(Fault f) { return FaultSet{1} << static_cast<unsigned>(f); }
inline constexpr FaultSet all_faults = (FaultSet{1} << fault_count) - 1;
constexpr bool has(FaultSet faults, Fault f) { return (faults & bit(f)) != 0; }

/// What the firmware does while a fault is active, in the order of severity.
enum class Reaction : std::uint8_t {
  warn,              ///< publish only
  derate,            ///< halve the allowed currents
  forbid_charge,     ///< allow no charge current; open only if it flows all the same
  forbid_discharge,  ///< allow no discharge current; open only if it flows all the same
  open,              ///< allow no current; open when it is zero, or after a grace time
  open_now,          ///< severe: open at once, under any current
};

/// How a fault ends after its quantity has passed the release threshold.
enum class Recovery : std::uint8_t {
  automatic,  ///< after the recovery time of the table
  on_clear,   ///< by a clear command after the recovery time
  service,    ///< latched over a power cycle; then by a service command before any contactor closes
};

}  // namespace bms::protection
