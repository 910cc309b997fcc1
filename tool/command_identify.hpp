// bms identify: recordings in, a cell file with uncertainties out.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tool/output.hpp"

namespace bms::tool {

struct IdentifyOptions {
  std::vector<std::string> recordings;
  std::vector<std::string> ocv;  ///< slow charge and discharge
  std::string model = "nlgr";
  std::string optimizer = "nls";
  std::string start = "table9";  ///< cell file to begin from: limits, and what is not identified
  std::string initial_soc;       ///< a number, "estimate", or empty: soc_ref if there is one, else estimate
  std::string window;            ///< "HI:LO" of soc, empty: all
  std::vector<std::string> validate;
  std::string validate_window;  ///< empty: as `window`
  std::vector<double> nodes;    ///< soc nodes of R0, R1, C1; empty: by what the recordings cover
  double filter_hz = 0;         ///< low-pass on the current, zero phase; 0: none
  bool remove_offset = false;   ///< of the current, as its rests show it
  double ocv_error_v = 0.002;   ///< largest error of the OCV's straight pieces
  std::optional<double>
      ocv_branch;  ///< of the OCV between slow discharge (-1) and charge (1); not given: identified where it can be
  bool extend = false;     ///< what an estimator needs beyond the circuit
  double capacity_ah = 0;  ///< 0: of the OCV recordings, else of `start`
  std::string name;        ///< of the cell; empty: of the file that is written
  std::string out;
  Output output;
};

int run(const IdentifyOptions& options);

}  // namespace bms::tool
