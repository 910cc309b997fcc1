#include "files/logs/shipped_dbc.hpp"

namespace bms::files {

std::vector<DbcSignal> signals_of(const std::string& name) {
  return name == "pylontech" ? parse_dbc(pylontech_dbc, name) : read_dbc(name);
}

std::vector<std::string> shipped_map_of(const std::string& name) {
  if (name != "pylontech") return {};
  return {"current_a=Measured.Current", "pack_voltage_v=Measured.Voltage", "temperature_c=Measured.Temperature",
          "soc_ref=State.StateOfCharge"};
}

}  // namespace bms::files
