// bms experiment: a current profile by name, as CSV.
#pragma once

#include <string>

#include "tool/output.hpp"

namespace bms::tool {

struct ExperimentCommandOptions {
  std::string name;
  double capacity_ah = 6;
  unsigned long seed = 1;
  double step_s = 0;       ///< 0: as the design wants it, mostly 1
  double high_c_rate = 1;  ///< of pulses, in multiples of the 1C current
  double low_c_rate = 0.25;
  std::string out;
  Output output;
};

int run(const ExperimentCommandOptions& options);

/// Names and descriptions, one a line.
std::string experiment_list();

}  // namespace bms::tool
