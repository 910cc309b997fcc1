// bms diagnose: a cell file and recordings in; which physics or which fault of an instrument the cell file leaves out,
// and proof on recordings that were not used.
#pragma once

#include <string>
#include <vector>

#include "tool/output.hpp"

namespace bms::tool {

struct DiagnoseOptions {
  std::string cell;
  std::vector<std::string> recordings;
  std::vector<std::string> holdouts;  ///< later recordings: compared with, nothing else
  std::vector<double> initial_soc;    ///< what the user believes, of all recordings or of each; not given: soc_ref's
                                      ///< first value, else the first voltage tells
  std::string out;                    ///< cell file with what was found; empty: none
  Output output;
};

int run(const DiagnoseOptions& options);

}  // namespace bms::tool
