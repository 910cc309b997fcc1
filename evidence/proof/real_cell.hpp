// Real recordings of a list, and the cell file that is identified from the healthy ones among them.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "files/cell_file.hpp"
#include "files/toml_table.hpp"
#include "measurement/recording.hpp"

namespace bms::proof {

/// A [[set]] of the list: recordings of one cell.
struct RealSet {
  std::string name, cell, start, chemistry, test;
  std::string calibration_current;  ///< column of `calibration` in the place of current_a; empty: none
  double calibration_from_s = 0;    ///< and only its rows from this time on
  double capacity_ah = 0, cells_in_parallel = 1;
  bool held_out = false;  ///< the rules were not developed on this cell
  bool ocv_from_rests = false, ocv_from_load = false;
  std::optional<double> initial_soc, test_initial_soc;  ///< of `calibration`, of `test`; nothing: soc_ref
  std::vector<std::string> calibration, healthy, ocv;
};

/// All [[set]] of the list.
std::vector<RealSet> read_sets(files::TomlTable& list);

/// Files that a set needs.
std::vector<std::string> files_of(const RealSet& set);

/// Which entries of a list have their recordings in the folder of the data. A list may name more than a folder has.
class Present {
 public:
  /// Throws BadInput if there is no such folder.
  explicit Present(std::string data_folder);
  /// Returns true if all files are there. Otherwise counts and remembers the entry, once per name.
  bool has(const std::string& entry, const std::vector<std::string>& files);
  std::size_t skipped() const { return skipped_.size(); }
  /// What was skipped, in one line with its end; empty: nothing. what: "sets".
  std::string skipped_text(const std::string& what) const;

 private:
  std::string folder_, first_missing_;
  std::vector<std::string> skipped_;
};

/// The identified cell and the recording that is left out.
struct Prepared {
  files::CellFile cell;
  measurement::Recording test;
};

/// Throws a runtime_error if no cell file follows from the recordings. learn_healthy: with [healthy].
Prepared prepare(const std::string& data_folder, const RealSet& set, bool learn_healthy);

}  // namespace bms::proof
