// What a person wants to know of a battery, picked from the bus by the names of the DBC file: the same for the screen,
// the plain lines, the JSON and the page. What the DBC file or the bus does not have is not known, and not shown.
#pragma once

#include <string>
#include <vector>

#include "monitor/bus_state.hpp"

namespace bms::monitor {

/// Something said in words, and whether it is still so.
struct TextItem {
  std::string text;
  std::string comment;
  bool stale = false;
};

struct PackView {
  Reading soc_percent, soc_sigma_percent, soc_display_percent;
  TextItem soc_quality;
  Reading voltage_v, current_a, temperature_c;
  Reading discharge_now_a, charge_now_a, discharge_10s_a, charge_10s_a;
  Reading capacity_percent, capacity_sigma_percent, resistance_percent, resistance_sigma_percent;
  std::vector<Reading> cells_v;         ///< CellVoltages*.Cell1, Cell2, ... up to the highest that was ever heard
  std::vector<TextItem> contactor;      ///< ContactorState: its State, the bits that are set, what else it says
  bool faults_received = false;         ///< a message Faults is there
  std::vector<TextItem> faults;         ///< its bits that are set
  std::vector<TextItem> fault_details;  ///< what is no bit and not zero, in words
  std::vector<TextItem> flags;          ///< why the estimate is worth less: the bits of Status.Flags

  /// Lowest, highest and mean of the cells that are known; count 0: none.
  struct Cells {
    std::size_t count = 0, lowest = 0, highest = 0;  ///< lowest, highest: index into cells_v
    double lowest_v = 0, highest_v = 0, mean_v = 0;
  };
  Cells cells() const;
};

PackView pack_view(const BusState& bus);

/// A value of a signal in words, if the DBC file has them for it; else the number with its unit; "-" when not known.
std::string text_of(const SignalInfo& signal, double value);

}  // namespace bms::monitor
