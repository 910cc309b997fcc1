// bms hil: firmware in the loop with a simulated pack or a recording.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tool/output.hpp"

namespace bms::tool {

struct HilOptions {
  std::string board = "netduinoplus2";
  std::string port;  ///< of a real board; empty: emulated
  std::string cell = "table9", board_cell;
  std::string profile, recording;  ///< one of them
  double initial_soc = 0.9;
  std::optional<double> announced_soc;
  double sample_period_s = 0.1;
  unsigned seed = 1;
  std::vector<std::string> faults;
  std::string candump;
  Output output;
};

/// Exit code 1: a fault that was put in was not told in its time, or a wrong state of charge was told as valid.
int run(const HilOptions& options);

}  // namespace bms::tool
