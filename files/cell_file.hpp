// Cell files: TOML in, checked parameters out. The format is described in model/cells/README.md; what is refused, and
// in which words, by model::first_fault. Unknown keys are refused too: a misspelt one would otherwise be silently
// ignored.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "model/cell_parameters.hpp"
#include "model/extended.hpp"

namespace bms::files {

/// R0, R1, C1 at a temperature: identified, kept for what will use it; the model runs on [rc].
struct TemperatureTable {
  double temperature_c = 25;
  model::RcTable<double> rc;
};

struct CellFile {
  std::string name;
  std::string chemistry;
  std::string source;  ///< where its values come from
  std::map<std::string, std::string>
      sources;             ///< the same, table by table; of a mechanism: "mechanism.ID", "instrument.ID"
  std::string path;        ///< as given; built-in cells: their name
  std::string text;        ///< the file itself
  std::uint32_t hash = 0;  ///< first 32 bits of the text's SHA-256: tells on CAN which file is on the board
  model::CellParameters<> parameters;
  std::vector<TemperatureTable> at_temperature;     ///< ascending; empty: not known
  std::vector<model::MechanismSetting> mechanisms;  ///< what the 1RC model leaves out; ascending index, each once
};

/// The table that a mechanism stands in: "mechanism.ID" or "instrument.ID".
std::string table_of(const model::MechanismInfo& mechanism);

/// What is expected of a parameter, for a person: "0 to 0.07 V".
std::string range_of(const model::Parameter& parameter, double capacity_ah);

/// Adds the mechanism to the file, or puts it in the place of the one of its kind.
void put_mechanism(CellFile& file, const model::MechanismSetting& setting);

/// name_or_path: the name of a built-in cell or the path of a file. Throws BadInput.
CellFile read_cell(const std::string& name_or_path);

/// The same from text; `path` is for messages only.
CellFile parse_cell(const std::string& text, const std::string& path);

/// A cell file with these values: parse_cell() of it gives them back, digit for digit.
std::string cell_text(const CellFile& file);

/// Those that an estimator runs.
std::vector<model::MechanismSetting> on_board(const std::vector<model::MechanismSetting>& mechanisms);

/// Throws BadInput when one of those needs an FPU.
void reject_if_fpu_needed(const CellFile& file);

struct BuiltInCell {
  std::string name;
  std::string text;
};
const std::vector<BuiltInCell>& built_in_cells();

/// Their names, for a person.
std::string cell_names();

}  // namespace bms::files
