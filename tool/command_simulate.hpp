// bms simulate: a current (of a recording or a profile) through the model, open loop.
#pragma once

#include <string>
#include <vector>

#include "tool/output.hpp"

namespace bms::tool {

struct SimulateOptions {
  std::string cell;
  std::string recording;  ///< one of the two
  std::string profile;
  std::vector<std::string> with;  ///< "ID:param=value,...": mechanisms to add to the cell's, or to put in their place
  double initial_soc = 0.5;
  double noise_v = 0;  ///< standard deviation of noise added to the voltage
  double noise_a = 0;  ///< and to the current that is written
  unsigned long seed = 1;
  std::string out;
  Output output;
};

int run(const SimulateOptions& options);

}  // namespace bms::tool
