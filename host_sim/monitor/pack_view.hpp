// The quantities of the battery, selected from the bus by the names of the DBC file. The screen, the status line, the
// JSON and the live page all use it. Signals that the DBC file or the bus does not contain are unknown and not shown.
#pragma once

#include <string>
#include <vector>

#include "monitor/bus_state.hpp"

namespace bms::monitor {

/// A text, for example the name of a fault, and whether it is stale.
struct TextItem {
  std::string text;
  std::string comment;
  bool stale = false;
};

struct PackView {
  Reading soc_percent, soc_sigma_percent, soc_display_percent;
  TextItem soc_quality;
  int soc_quality_value = -1;  ///< of the signal SocQuality; -1: invalid or not received
  Reading voltage_v, current_a, temperature_c;
  Reading front_end_c;  ///< die of the measuring chip
  Reading discharge_now_a, charge_now_a, discharge_10s_a, charge_10s_a;
  Reading capacity_percent, capacity_sigma_percent, resistance_percent, resistance_sigma_percent;
  std::vector<Reading> cells_v;         ///< CellVoltages*.Cell1, Cell2, ... up to the highest that was received
  std::vector<TextItem> contactor;      ///< ContactorState: its State, the bits that are set, its other signals
  bool faults_received = false;         ///< a message Faults was received
  std::vector<TextItem> faults;         ///< the bits of Faults and MoreFaults that are set
  std::vector<TextItem> fault_details;  ///< the other signals of Faults that are not zero
  std::vector<TextItem> flags;          ///< the bits of Status.Flags that are set: limitations of the estimate

  /// Lowest, highest and mean of the cells with a known voltage; `count` is their number.
  struct Cells {
    std::size_t count = 0, lowest = 0, highest = 0;  ///< lowest, highest: index into cells_v
    double lowest_v = 0, highest_v = 0, mean_v = 0;
  };
  Cells cells() const;
};

PackView pack_view(const BusState& bus);

/// The value's name in the DBC file, or the number with its unit, or "-" if the value is invalid.
std::string text_of(const SignalInfo& signal, double value);

}  // namespace bms::monitor
