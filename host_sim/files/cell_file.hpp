// Reads and writes cell files (TOML). model/cells/README.md describes the format; model::first_fault checks the ranges.
// Unknown keys are rejected, because a misspelt key would otherwise be ignored.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "healthy_data/healthy_data.hpp"
#include "model/cell_parameters.hpp"
#include "model/extended.hpp"
#include "model/pulse_ratings.hpp"

namespace bms::files {

/// R0, R1, C1 identified at a temperature. For information: the model uses [rc].
struct TemperatureTable {
  double temperature_c = 0;
  model::RcTable<double> rc;
};

struct CellFile {
  std::string name;
  std::string chemistry;
  std::string source;                          ///< origin of its values
  std::map<std::string, std::string> sources;  ///< origin by table: "ocv", "mechanism.ID", "instrument.ID"
  std::string path;                            ///< as given; of a built-in cell: its name
  std::string text;                            ///< the file itself
  std::uint32_t hash = 0;                      ///< first 32 bits of the SHA-256 of the text: identifies the file on CAN
  model::CellParameters<> parameters;
  model::PulseRatings pulses;                    ///< of the maker, optional
  std::vector<TemperatureTable> at_temperature;  ///< ascending by temperature; empty: unknown
  std::vector<model::MechanismSetting>
      mechanisms;                     ///< effects that the 1RC model does not contain; ascending index, each once
  healthy_data::HealthyData healthy;  ///< what healthy recordings of the cell leave unexplained; empty: unknown
};

/// Name of the table of a mechanism: "mechanism.ID" or "instrument.ID".
std::string table_of(const model::MechanismInfo& mechanism);

/// Allowed range of a parameter, for messages: "0 to 0.07 V".
std::string range_of(const model::Parameter& parameter, double capacity_ah);

/// Adds the mechanism to the file, or replaces the one of the same index.
void put_mechanism(CellFile& file, const model::MechanismSetting& setting);

/// Reads a built-in cell by its name, or a file by its path. Throws BadInput.
CellFile read_cell(const std::string& name_or_path);

/// Parses the text of a cell file; `path` is for messages only. Throws BadInput.
CellFile parse_cell(const std::string& text, const std::string& path);

/// Text of a cell file with these values. parse_cell() of it returns the same bits.
std::string cell_text(const CellFile& file);

/// The mechanisms that the estimator on a board computes. A mechanism with states whose strengths are all neutral is
/// left out: it has no effect, and a state without variance and noise would make the filter divide 0 by 0.
std::vector<model::MechanismSetting> on_board(const std::vector<model::MechanismSetting>& mechanisms);

/// Throws BadInput if one of those needs an FPU, or if fixed point does not hold their resistances.
void reject_if_fpu_needed(const CellFile& file);

struct BuiltInCell {
  std::string name;
  std::string text;
};
const std::vector<BuiltInCell>& built_in_cells();

/// Names of the built-in cells, for messages.
std::string cell_names();

}  // namespace bms::files
