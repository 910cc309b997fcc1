// What to visit first: what many recordings of a depot say together.
//
// Each cell is compared with itself over time and with its neighbours, which share its current sensor:
//
//   off         recordings whose diagnosis names a cause or cannot explain a mismatch. A healthy recording is off with
//               a known rate; recordings of one cell are alike, so false alarms are more dispersed than by chance
//   shared      more than half of a battery's cells are off on the same day: the cause is what they share
//   discharged  the charge at the start of a shift falls against that of the neighbours: a self-discharge
//   weak        the estimates of the capacity are together below those of the neighbours, though none alone is
//   drifting    the offset of the current sensor, estimated by all cells, begins to change
//
// All these hypotheses, of all cells and batteries, share one false discovery rate (Benjamini and Hochberg).
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fleet/history.hpp"
#include "fleet/statistics.hpp"

namespace bms::fleet {

struct AnalysisOptions {
  double false_discovery_rate = 0.05;  ///< share of the issues that may be false
  double resistance_limit = 0.5;       ///< relative growth at which a cell is replaced
  double capacity_limit = 0.2;         ///< lost share of the capacity at which a cell is replaced
};

/// Something that is wrong with a battery or a cell.
struct Issue {
  std::string truck, cell_index;  ///< cell_index is empty: the whole battery
  std::string cause;              ///< id of a mechanism; "unknown", "data_fault"
  std::vector<std::string> also;  ///< further mechanisms that its recordings name
  std::size_t seen = 0, of = 0;   ///< days or recordings that show it, and those that could
  double p_value = 1, rate = 1;   ///< rate: smallest false discovery rate at which it is accepted
  bool by_comparison = false;     ///< found against the neighbours, not by the diagnosis of single recordings
  bool confirmed = false;
  std::optional<double> onset_day;
  std::optional<Strength> size;  ///< in the unit of the mechanism's first parameter; of the last recordings
  std::string unit;
  std::optional<double> per_day;    ///< change of the size
  std::size_t cell = 0, entry = 0;  ///< the recording that shows it best: History::cells[cell].entries[entry]
};

/// A quantity of a cell over time, and when it reaches its limit.
struct Course {
  std::vector<Reading> readings;  ///< ascending by day
  std::optional<Trend> trend;
  Outlook outlook = Outlook::few_readings;
  std::optional<Crossing> crossing;  ///< of Outlook::forecast
};

/// Longest time that a trend is continued.
inline constexpr double forecast_days = 3'650;

struct CellTrends {
  Course resistance, capacity;
};

struct Analysis {
  std::vector<Issue> issues;       ///< confirmed ones first, in the order of a visit
  std::vector<CellTrends> trends;  ///< by cell
  std::size_t trucks = 0, usable = 0, errors = 0;
};

Analysis analyse(const History& history, const AnalysisOptions& options);

}  // namespace bms::fleet
