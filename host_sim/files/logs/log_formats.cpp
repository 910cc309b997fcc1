#include "files/logs/log_formats.hpp"

#include <algorithm>
#include <array>
#include <charconv>

namespace bms::files {

namespace {

constexpr std::array formats = {
    LogFormat{"bdf", "Battery Data Format",
              "|test time / s|test time second|voltage / v|voltage volt|current / a|current ampere|", false, false},
    LogFormat{"biologic", "BioLogic EC-Lab text", "|ecell/v|ewe/v|<ewe>/v|<i>/ma|i/ma|time/s|", false, false},
    LogFormat{"pec", "PEC",
              "|total time (seconds)|total time (hours in hh:mm:ss.xxx)|position start time|rack|load on time|", true,
              false},
    LogFormat{"maccor", "Maccor", "|rec#|cyc#|test (sec)|test (min)|test time (sec)|dpt time|md|testtime(s)|", true,
              true},
    LogFormat{"arbin", "Arbin", "|data point|test time(s)|test time (s)|data point(s)|", true, false},
    LogFormat{"neware", "Neware",
              "|datapoint|record id|record index|record number|total time|realtime|time(h:min:s.ms)|absolute time|",
              true, false},
    LogFormat{"leafspy", "LeafSpy", "|cp mv diff|max cp mv|gids|", true, false, {}, "mV"},
    LogFormat{"scanmytesla", "Scan My Tesla", "|cell temp min|cell temp avg|cell temp mid|", true, false, "ms", "V"},
    LogFormat{"csv", "table", "", false, false},
};

struct Names {
  Quantity quantity;
  std::string_view bases;  ///< the best first; separated and surrounded by '|'
};
constexpr std::array all_names = {
    Names{Quantity::time,
          "|test time|testtime|total time|elapsed time|realtime|absolute time|time|test|unix time|date time|datetime|"
          "dpt time|timestamp|time stamp|date/time|date|epoch|zeit|t|runtime|run time|"},
    Names{Quantity::current,
          "|current|i|<i>|amps|cur|curr|pack current|pack|battery current|batt current|i batt|ibatt|ibat|i bat|strom|"},
    Names{Quantity::voltage,
          "|voltage|volts|ecell|ewe|<ewe>|cell voltage|v|u|vol|battery voltage|batt voltage|u batt|v batt|vbat|ubat|"
          "potential|spannung|"},
    Names{Quantity::temperature,
          "|temperature|temp|cell temperature|temp 1|temperature 1|t1|temperature t1|surface temperature t1|"
          "surface temperature|aux temperature 1|aux temperature|temperatur|ambient temperature|"},
    Names{Quantity::pack_voltage, "|pack voltage|pack|total voltage|stack voltage|sum voltage|sumvoltage|bus voltage|"},
    Names{Quantity::soc_ref, "|soc ref|"},
    Names{Quantity::current_ref, "|current ref|"},
    Names{Quantity::voltage_ref, "|voltage ref|"},
    Names{Quantity::state, "|state|md|mode|"},
};

/// Heading and machine-readable name of the Battery Data Format (public specification of the Battery Data Alliance),
/// and the column of a recording, if it has one.
struct BdfName {
  std::string_view label, machine, column;
};
constexpr std::array bdf_names = {
    BdfName{"Test Time / s", "test_time_second", "time_s"},
    BdfName{"Voltage / V", "voltage_volt", "voltage_v"},
    BdfName{"Current / A", "current_ampere", "current_a"},
    BdfName{"Surface Temperature T1 / degC", "temperature_t1_celsius", "temperature_c"},
    BdfName{"Unix Time / s", "unix_time_second", ""},
    BdfName{"Cycle Count / 1", "cycle_count", ""},
    BdfName{"Step Count / 1", "step_count", ""},
    BdfName{"Step Index / 1", "step_index", ""},
    BdfName{"Ambient Temperature / degC", "ambient_temperature_celsius", ""},
    BdfName{"Surface Temperature T2 / degC", "temperature_t2_celsius", ""},
    BdfName{"Surface Temperature T3 / degC", "temperature_t3_celsius", ""},
    BdfName{"Surface Temperature T4 / degC", "temperature_t4_celsius", ""},
    BdfName{"Surface Temperature T5 / degC", "temperature_t5_celsius", ""},
    BdfName{"Charging Capacity / Ah", "charging_capacity_ah", ""},
    BdfName{"Discharging Capacity / Ah", "discharging_capacity_ah", ""},
    BdfName{"Step Capacity / Ah", "step_capacity_ah", ""},
    BdfName{"Net Capacity / Ah", "net_capacity_ah", ""},
    BdfName{"Cumulative Capacity / Ah", "cumulative_capacity_ah", ""},
    BdfName{"Charging Energy / Wh", "charging_energy_wh", ""},
    BdfName{"Discharging Energy / Wh", "discharging_energy_wh", ""},
    BdfName{"Step Energy / Wh", "step_energy_wh", ""},
    BdfName{"Net Energy / Wh", "net_energy_wh", ""},
    BdfName{"Cumulative Energy / Wh", "cumulative_energy_wh", ""},
    BdfName{"Power / W", "power_watt", ""},
    BdfName{"Internal Resistance / Ohm", "internal_resistance_ohm", ""},
    BdfName{"Ambient Pressure / Pa", "ambient_pressure_pa", ""},
    BdfName{"Applied Pressure / Pa", "applied_pressure_pa", ""},
};

/// The rest after a prefix, as a number from 1; 0 otherwise.
std::size_t number_after(std::string_view text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return 0;
  text.remove_prefix(prefix.size());
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || number > 1'000) return 0;
  const std::string_view rest(end, static_cast<std::size_t>(text.data() + text.size() - end));
  return rest.empty() || rest == " voltage" || rest == " temperature" ? number : 0;
}

}  // namespace

std::span<const LogFormat> log_formats() { return formats; }

const LogFormat* log_format(std::string_view name) {
  const auto at = std::find_if(formats.begin(), formats.end(), [&](const LogFormat& f) { return f.name == name; });
  return at == formats.end() ? nullptr : &*at;
}

std::string log_format_names() {
  std::string names;
  for (const LogFormat& format : formats) names += std::string(format.name) + ", ";
  return names + "candump, battery-emulator, asc, gvret, trc, busmaster";
}

int rank_of(Quantity quantity, std::string_view base) {
  if (base.empty()) return -1;
  for (const Names& names : all_names) {
    if (names.quantity != quantity) continue;
    const std::size_t at = names.bases.find("|" + std::string(base) + "|");
    return at == std::string_view::npos ? -1 : static_cast<int>(at);
  }
  return -1;
}

std::size_t cell_number(Quantity quantity, std::string_view base) {
  constexpr std::array voltage = {"cell voltage ", "cell v ", "cell ", "vcell ", "vcell", "v cell ",
                                  "ucell ",        "u cell ", "cell",  "v ",     "u ",    "cp"};
  constexpr std::array temperature = {"cell temperature ", "temperature ", "temp ", "t ", "tcell", "tcell "};
  if (quantity == Quantity::cell_voltage) {
    for (const char* prefix : voltage) {
      if (const std::size_t k = number_after(base, prefix)) return k;
    }
  } else if (quantity == Quantity::cell_temperature) {
    for (const char* prefix : temperature) {
      if (const std::size_t k = number_after(base, prefix)) return k;
    }
  }
  return 0;
}

std::string bdf_label(std::string_view column) {
  for (const BdfName& name : bdf_names) {
    if (!column.empty() && name.column == column) return std::string(name.label);
  }
  return {};
}

std::string machine_name(const std::string& label) {
  const auto at = std::find_if(bdf_names.begin(), bdf_names.end(), [&](const BdfName& n) { return n.label == label; });
  return at == bdf_names.end() ? label : std::string(at->machine);
}

std::string label_of_machine_name(const std::string& machine) {
  const auto at =
      std::find_if(bdf_names.begin(), bdf_names.end(), [&](const BdfName& n) { return n.machine == machine; });
  return at == bdf_names.end() ? machine : std::string(at->label);
}

}  // namespace bms::files
