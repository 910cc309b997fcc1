// What the merged table says of each cell, in order of time.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace bms::fleet {

/// A strength with its standard deviation.
struct Strength {
  double value = 0, sigma = 0;
};

/// A mechanism that a diagnosis named.
struct Named {
  std::string mechanism, unit;
  double probability = 0, gain = 0;
  std::optional<Strength> strength;
  std::vector<std::string> equivalent;  ///< mechanisms that the recording cannot distinguish from it
  /// Returns true if it is, or may be, this mechanism.
  bool may_be(const std::string& id) const;
};

/// One recording of one cell.
struct Entry {
  double day = 0;  ///< since the first recording of the depot; without dates: 0, 1, 2, ...
  std::string recording, page, verdict, statement, error;
  std::vector<Named> named;
  std::optional<Strength> resistance;      ///< relative change of the ohmic resistance
  std::optional<Strength> capacity;        ///< lost share of the capacity
  std::optional<Strength> current_offset;  ///< [A], with the leakage of the cell, which looks the same
  std::optional<Strength> initial_soc;
  /// Returns true if the recording could be diagnosed.
  bool usable() const;
  const Named* find(const std::string& mechanism) const;
};

struct CellHistory {
  std::string truck, cell_index;
  std::vector<Entry> entries;  ///< ascending by day
};

struct History {
  std::string task, version;
  std::optional<double> first_day_s;  ///< 1970-based time of day 0; nothing without dates
  std::vector<CellHistory> cells;     ///< ascending by truck and index
  std::size_t recordings = 0;
};

/// Reads fleet.sqlite. Throws BadInput.
History read_history(const std::filesystem::path& table);

}  // namespace bms::fleet
