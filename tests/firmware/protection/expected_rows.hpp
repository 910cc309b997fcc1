// Expected table for sixteen cells of the paper's kind (2.0 to 3.65 V, 6 A, -20 to 60 degrees C, ten samples per
// second), calculated by hand, so that a wrong table entry differs.
#pragma once

#include <cstdint>

#include "protection/pack_design.hpp"
#include "protection/table.hpp"

namespace bms::protection {

inline constexpr model::Limits table9_limits{.voltage_min_v = 2.0,
                                             .voltage_max_v = 3.65,
                                             .charge_current_max_a = 6,
                                             .discharge_current_max_a = 6,
                                             .temperature_min_c = -20,
                                             .temperature_max_c = 60};
inline constexpr PackDesign forklift{.limits = table9_limits, .capacity_ah = 6, .cells = 16, .temperatures = 4};

struct ExpectedRow {
  const char* name;
  const char* signal;  ///< signal of frame Faults, from row 32 on of MoreFaults
  char beyond;         ///< '>' or '<'
  std::int32_t threshold;
  int delay_ms;
  std::int32_t release;
  int recover_ms;
  char recovery;  ///< 'a'utomatic, 'c'lear, 's'ervice
  const char* reaction;
};

inline constexpr ExpectedRow expected_rows[] = {
    {"cell overvoltage warning", "CellOvervoltageWarning", '>', 3'650'000, 1'000, 3'600'500, 5'000, 'a', "derate"},
    {"cell overvoltage", "CellOvervoltage", '>', 3'699'500, 2'000, 3'551'000, 60'000, 'a', "forbid charge"},
    {"cell overvoltage severe", "CellOvervoltageSevere", '>', 3'815'000, 200, 3'551'000, 10'000, 'c', "open now"},
    {"cell undervoltage warning", "CellUndervoltageWarning", '<', 2'495'000, 5'000, 2'594'000, 5'000, 'a', "derate"},
    {"cell undervoltage", "CellUndervoltage", '<', 2'000'000, 2'000, 2'907'500, 60'000, 'a', "forbid discharge"},
    {"cell undervoltage severe", "CellUndervoltageSevere", '<', 1'802'000, 200, 2'000'000, 10'000, 'c', "open now"},
    {"pack overvoltage", "PackOvervoltage", '>', 58'928'000, 2'000, 56'816'000, 60'000, 'a', "forbid charge"},
    {"pack undervoltage", "PackUndervoltage", '<', 33'584'000, 2'000, 46'520'000, 60'000, 'a', "forbid discharge"},
    {"charge overcurrent", "ChargeOvercurrent", '>', 30'000'000, 0, 15'000'000, 30'000, 'a', "forbid charge"},
    {"discharge overcurrent", "DischargeOvercurrent", '>', 30'000'000, 0, 15'000'000, 30'000, 'a', "forbid discharge"},
    {"short circuit", "ShortCircuit", '>', 30'000'000, 0, 6'000'000, 10'000, 's', "open now"},
    {"overtemperature warning", "OvertemperatureWarning", '>', 5'500, 5'000, 5'200, 30'000, 'a', "derate"},
    {"overtemperature", "Overtemperature", '>', 6'000, 5'000, 5'000, 60'000, 'a', "open"},
    {"charge overtemperature", "ChargeOvertemperature", '>', 4'500, 5'000, 4'200, 60'000, 'a', "forbid charge"},
    {"undertemperature", "Undertemperature", '<', -2'000, 5'000, -1'700, 60'000, 'a', "forbid discharge"},
    {"charge undertemperature", "ChargeUndertemperature", '<', 0, 5'000, 200, 60'000, 'a', "forbid charge"},
    {"open wire", "OpenWire", '>', 247'500, 500, 99'000, 10'000, 'c', "open"},
    {"imbalance", "Imbalance", '>', 330'000, 30'000, 198'000, 60'000, 'a', "warn"},
    {"current implausible", "CurrentImplausible", '>', 0, 60'000, 0, 60'000, 'a', "derate"},
    {"sum mismatch", "SumMismatch", '>', 440'000, 1'000, 280'000, 10'000, 'c', "open"},
    {"voltage missing", "VoltageMissing", '>', 0, 500, 0, 5'000, 'a', "open"},
    {"voltage stuck", "VoltageStuck", '>', 0, 1'000, 0, 10'000, 'c', "open"},
    {"current missing", "CurrentMissing", '>', 0, 500, 0, 5'000, 'a', "open"},
    {"temperature lost", "TemperatureLost", '>', 0, 2'000, 0, 10'000, 'a', "derate"},
    {"temperature stuck", "TemperatureStuck", '>', 0, 10'000, 0, 60'000, 'a', "derate"},
    {"deep discharge", "DeepDischarge", '<', 1'500'000, 10'000, 1'600'000, 0, 's', "open"},
    {"precharge failed", "PrechargeFailed", '>', 0, 0, 0, 10'000, 'a', "open now"},
    {"contactor welded", "ContactorWelded", '>', 0, 200, 0, 10'000, 's', "open now"},
    {"contactor not closed", "ContactorNotClosed", '>', 0, 300, 0, 10'000, 'a', "open now"},
    {"samples missing", "SamplesMissing", '>', 500'000, 0, 200'000, 1'000, 'a', "open now"},
    {"internal fault", "InternalFault", '>', 0, 0, 0, 0, 'c', "open now"},
    {"storage fault", "StorageFault", '>', 0, 0, 0, 0, 'c', "warn"},
    {"second line tripped", "SecondLineTripped", '>', 0, 0, 0, 10'000, 'c', "open now"},
    {"second line failed", "SecondLineFailed", '>', 0, 200, 0, 10'000, 's', "open now"},
    {"current sensors differ", "CurrentSensorsDiffer", '>', 20'000'000, 2'000, 10'000'000, 10'000, 'c', "open"},
    {"temperature unknown", "TemperatureUnknown", '>', 0, 60'000, 0, 10'000, 'a', "open"},
    {"current unrequested", "CurrentUnrequested", '>', 0, 60'000, 0, 10'000, 'a', "open"},
    {"allowed current exceeded", "AllowedCurrentExceeded", '>', 0, 10'000, 0, 10'000, 'a', "warn"},
    {"charge limit exceeded", "ChargeLimitExceeded", '>', 3'600'000, 0, 1'800'000, 10'000, 'a', "forbid charge"},
    {"discharge limit exceeded", "DischargeLimitExceeded", '>', 3'600'000, 0, 1'800'000, 10'000, 'a',
     "forbid discharge"},
    {"limit not obeyed", "LimitNotObeyed", '>', 10'800'000, 0, 10'200'000, 10'000, 'a', "open now"},
    {"supply dip", "SupplyDip", '>', 0, 0, 0, 1'000, 'a', "open now"},
    {"thermistor shorted", "ThermistorShorted", '>', 0, 10'000, 0, 10'000, 'a', "open"},
    {"second current missing", "SecondCurrentMissing", '>', 0, 5'000, 0, 10'000, 'a', "derate"},
    {"interlock open", "InterlockOpen", '>', 0, 200, 0, 5'000, 'a', "open now"},
    {"crash", "Crash", '>', 0, 0, 0, 10'000, 's', "open now"},
    {"insulation low", "InsulationLow", '<', 5'840, 10'000, 7'300, 60'000, 'a', "forbid charge"},
    {"insulation unknown", "InsulationUnknown", '>', 0, 60'000, 0, 10'000, 'a', "warn"},
    {"front end hot", "FrontEndHot", '>', 9'500, 2'000, 8'500, 60'000, 'a', "open"},
    {"group incomplete", "GroupIncomplete", '>', 0, 1'000, 0, 5'000, 'a', "warn"},
};

}  // namespace bms::protection
